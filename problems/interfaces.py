"""The optional interfaces of a problem: what it may provide in addition to its outputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast

import numpy as np

from ..errors import Fault
from ..records import Bars, UnitsShown
from ..section import Array
from .declaration import Interval
from .limits import impossible
from .settings import rising, unit_slips

if TYPE_CHECKING:
    import pandas as pd

    from ..models.capability import PartSample
    from ..models.costs import CostCurve
    from .forms import Form
    from .tolerance_problem import ToleranceProblem

__all__ = [
    "Accuracy",
    "Checks",
    "Comparison",
    "Differentiable",
    "Documented",
    "Drawing",
    "Interface",
    "Page",
    "Provable",
    "Stored",
    "Variant",
    "WithEffects",
    "Written",
    "refuse_lost_members",
]

# The common base of the optional interfaces of a problem.


class Interface:
    """What a problem may provide in addition to its outputs; every member has a default.

    A problem inherits the interface to replace members. Callers ask `Interface.of(problem)` and
    need not know whether it does.
    """

    owners: ClassVar[dict[str, type[Interface]]] = {}
    """The interface of each public member."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if Interface in cls.__bases__:
            members = (name for name in vars(cls) if not name.startswith("_"))
            Interface.owners |= dict.fromkeys(members, cls)

    @classmethod
    def of(cls, problem: ToleranceProblem) -> Self:
        """The problem itself where it implements the interface, otherwise the defaults for it."""
        if isinstance(problem, cls):
            return problem
        defaults = cls()
        defaults.__dict__["_described"] = problem
        return defaults

    @property
    def _problem(self) -> ToleranceProblem:
        """The problem that the interface belongs to."""
        return cast("ToleranceProblem", self.__dict__.get("_described", self))


def refuse_lost_members(problem_class: type) -> None:
    """Raises TypeError where a class of problems defines a member of an interface that it does not
    inherit: it would never be asked for.
    """
    for name in vars(problem_class):
        owner = Interface.owners.get(name)
        if owner is not None and not issubclass(problem_class, owner):
            raise TypeError(
                f"{problem_class.__name__}.{name} belongs to the interface {owner.__name__}: "
                f"inherit {owner.__name__} as well"
            )


# The same problem at other accuracies than that of a search.


class Accuracy(Interface):
    """A finer problem for reported points, a coarser one for algorithms that evaluate much."""

    def reported(self) -> ToleranceProblem:
        """The same problem at the accuracy that reported points need."""
        return self._problem

    def coarser(self) -> ToleranceProblem:
        """The same problem on a smaller sample, for algorithms that evaluate much."""
        return self._problem

    def smooth(self) -> ToleranceProblem:
        """The same problem whose values in a search are smooth, for searches by gradients."""
        return self._problem

    def needed(self, designs: Array) -> dict[str, Array]:
        """Outputs (n,) of full designs as reported: at least the cost, and those that objectives
        and limits name.
        """
        return self._problem.outputs_of(designs, errors=False)


# What the page of a run shows of a problem in addition to the front.


class Page(Interface):
    """Title, charts and remarks of a problem."""

    def title(self) -> str:
        """The mechanism in words, for the heading of a page; empty where the name says it."""
        return self._problem.settings.labels.name

    def mechanism(self) -> dict[str, object]:
        """What readers know the mechanism by, for pages, terminal and exports: `name`,
        `description`, `drawing`, as far as they are stated.
        """
        return {**replace(self._problem.settings.labels, name=self.title()).stated()}

    def sketch(self) -> dict[str, Any]:
        """A drawing of the machine: `parts`, each a `name`, `points` [mm] of a line, and the
        columns of a front that are its shares; `poses` [mm]. Empty where there is none.
        """
        return {}

    def bars(self) -> tuple[Bars, ...]:
        """Charts of what matters in this problem, whatever is optimised."""
        return ()

    def warnings(self) -> tuple[str, ...]:
        """What the user should know before trusting a run of this problem."""
        return ()

    def remarks(self, front: pd.DataFrame) -> tuple[str, ...]:
        """Remarks on the reported points; `front` has a row for each, as `frame` makes them."""
        return ()

    def validity(self) -> tuple[str, ...]:
        """Limits of validity of the model, a sentence each."""
        return ()


# What `tolevo check` reports on a problem in addition to its assumptions and its faults.


class Checks(Interface):
    """Cautions, measured samples, and faults of designs and searches."""

    def cautions(self) -> tuple[str, ...]:
        """How the configuration was understood, and what the user should know before a run."""
        problem = self._problem
        settings = problem.settings
        slips = map(str, unit_slips(problem))
        departures = (
            text
            for variable in problem.variables
            if (sample := settings.variables[variable.name].sample)
            for text in sample.departures(variable.name)
        )
        prices = filter(None, (rising(name, curve) for name, curve in settings.costs.items()))
        return (*settings.notes, *slips, *prices, *departures, *Page.of(problem).warnings())

    def samples(self) -> tuple[tuple[str, str, PartSample], ...]:
        """Name and unit of each measured quantity, and its sample."""
        problem = self._problem
        return tuple(
            (variable.name, variable.unit, sample)
            for variable in problem.variables
            if (sample := problem.settings.variables[variable.name].sample)
        )

    def out_of_reach(self) -> list[Fault]:
        """Limits that no design can meet."""
        return impossible(self._problem)

    def search_faults(self) -> list[Fault]:
        """What is wrong with a search of the problem, though its designs can be evaluated."""
        return []

    def misplaced(self, designs: Array) -> dict[str, dict[int, str]]:
        """Messages, by column and row, on designs that break more than variables' bounds."""
        return {}


# What a reported allocation is compared with: finer models, units, changed assumptions.


@dataclass(frozen=True, slots=True)
class Variant:
    """A problem with one changed assumption: which one, its new value, and the problem."""

    assumption: str
    value: str
    problem: ToleranceProblem


class Comparison(Interface):
    """Verdicts of a finer model, one unit among many, other assumptions and other machines."""

    def finer_verdicts(self, designs: Array) -> tuple[str, ...]:
        """A finer model's verdict on each full design (n, all variables), such as "by contact this
        allocation keeps 1 arcmin in 43 % of units"; empty where there is none.
        """
        return ()

    def model_labels(self, designs: Array) -> tuple[str, ...]:
        """The model of each full design (n, all variables), and a finer model's verdict.

        Empty texts where there is only one model.
        """
        alone = self._problem.declaration.model_statement
        verdicts = self.finer_verdicts(designs)
        if not alone or not verdicts:
            return (alone,) * len(designs)
        return tuple(f"{alone}; {verdict}" for verdict in verdicts)

    def shown_limit(self) -> tuple[str, float] | None:
        """Output and upper limit that choose the point whose units are shown."""
        return None

    def shown_units(self, design: Array) -> UnitsShown | None:
        """One unit and the population of a full design (all variables,), None without units."""
        return None

    def variants(self) -> tuple[Variant, ...]:
        """The problem as it is, then with one assumption changed at a time.

        They search the same free variables; empty where no assumption needs trying.
        """
        return ()

    def alternatives(self) -> dict[str, ToleranceProblem]:
        """The machine with another choice, by a label of it: its least cost is reported."""
        return {}


# How a problem is written back as a configuration, and what a run stores of it.


class Written(Interface):
    """Tables of a configuration that the problem reads itself."""

    def tables(self) -> dict[str, Any]:
        """The top-level tables that the problem is written in, where `configured` reads them.

        They take the place of parameters, variables, costs and propagation.
        """
        return {}

    def more_tables(self) -> dict[str, Any]:
        """Top-level tables that `configured` reads in addition to the usual ones."""
        return {}


class Stored(Interface):
    """Arrays that took long to compute, which a run stores with its results."""

    def kept(self) -> dict[str, Array]:
        """Arrays by name that took long to compute and depend on the configuration alone."""
        return {}

    def adopt(self, arrays: Mapping[str, Array]) -> bool:
        """Take what another process has `kept`; whether it belongs to this configuration."""
        return False


# Derivatives of outputs, and designs that a search by gradients begins from.


class Differentiable(Interface):
    """A problem whose model gives derivatives."""

    def gradient(self, designs: Array) -> dict[str, Array]:
        """Derivatives (n, all variables) of the outputs for which the model gives them."""
        return {}

    def cost_slopes(self, designs: Array) -> Array:
        """Derivatives of the cost (n, all variables) at full designs (n, all variables)."""
        problem = self._problem
        slopes = np.zeros_like(designs)
        for name, curve in problem.settings.costs.items():
            slopes[:, problem.names.index(name)] = curve.slope(problem.column(designs, name))
        return slopes

    def starts(self) -> Array:
        """Full designs (k, all variables) that a search by gradients does well to begin from."""
        return np.empty((0, len(self._problem.variables)))


# What the documents print of a problem; by default nothing.


class Documented(Interface):
    """Allocations that a front is compared with."""

    def references(self) -> dict[str, Array]:
        """Allocations that the documents print, by label: full designs (all variables,)."""
        return {}

    def least_cost(self) -> tuple[str, ToleranceProblem] | None:
        """Label and problem of the documents' single-objective allocation, or None."""
        return None


# How the tolerance of a variable stands on a drawing; by default as its settings say.


class Drawing(Interface):
    """Ranges, zones, classes and prices of the variables of a problem."""

    def room(self, name: str, design: Array) -> Interval:
        """The range of a variable in which the rest of a full design (all variables,) leaves it."""
        problem = self._problem
        at = [variable.name for variable in problem.free].index(name)
        return float(problem.xl[at]), float(problem.xu[at])

    def zone(self, name: str) -> tuple[float | None, float]:
        """Nominal size of what a variable tolerates, None where it is not known, and the middle of
        its zone as a deviation from it, both in the unit of the variable.
        """
        return None, self._problem.settings.variables[name].mid or 0.0

    def drawn(self, name: str) -> Mapping[str, str]:
        """What the drawing says of the part that a variable tolerates: `class` (g6), `symbol`,
        number of the `drawing` and of the `characteristic`; what is not known is left out.
        """
        return {}

    def curves_of(self, name: str) -> tuple[tuple[CostCurve, float], ...]:
        """The cost curve of a variable and how often it is paid, one for each way of making it.

        Empty where nothing is paid, or where what is paid is no function of the variable alone.
        """
        curve = self._problem.settings.costs.get(name)
        return () if curve is None else ((curve, 1.0),)


# What physical effects change in a problem.


class WithEffects(Interface):
    """A problem in whose model effects of measured machines have a place."""

    def counterparts(self) -> tuple[str, ...]:
        """What each active effect does in this problem, in words; empty where it does nothing."""
        return ("",) * len(self._problem.settings.effects)

    def without_effects(self) -> ToleranceProblem:
        """The same problem with no effect in its model."""
        problem = self._problem
        return type(problem)(replace(problem.given, effects=()))

    def effect_notes(self) -> tuple[str, ...]:
        """A sentence for each active effect, those without a counterpart included."""
        settings = self._problem.settings
        missing = "has no counterpart in this problem: it changes nothing here"
        notes = tuple(
            f"effect {effect.effect.name}: {does}" if does else f"effect {effect.effect.name} {missing}"
            for effect, does in zip(settings.effects, self.counterparts(), strict=True)
        )
        zeros = ", ".join(settings.zero)
        why = "belongs to its instrument: it changes nothing in this problem"
        return (*notes, f"the zero of {zeros} {why}") if zeros else notes


# What bounds of the cost are proven with; by default nothing.


class Provable(Interface):
    """The convex form of a problem, and an exact front."""

    def form(self) -> Form | None:
        """The convex form that bounds of the cost are proven with, None where there is none."""
        return None

    def form_values(self, form: Form, designs: Array, outputs: Mapping[str, Array]) -> Array:
        """True values (n, r) of the requirements of the form, from the outputs of designs.

        With its own limit, a requirement has the value of that limit plus what is missing.
        """
        nothing = np.full(len(designs), -np.inf)
        return np.stack(
            [
                nothing if np.isfinite(most) else self._problem.values(designs, outputs, name)
                for name, most in zip(form.outputs, form.own_limits, strict=True)
            ],
            axis=1,
        )

    def form_columns(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        """Variables (n,) from features of the form (n,), where these are not variables."""
        return dict(columns)

    def stand_in_limit(self, name: str, high: float) -> float:
        """The upper limit of the requirement of the form that stands for a limit on an output."""
        return high

    def guide(self) -> Form | None:
        """A convex form close to the problem, to begin a search from; it proves nothing."""
        return self.form()

    def unproven(self) -> str:
        """Why an objective that might have a convex form has none here; empty where not known."""
        return ""

    def exact_front(self) -> Array | None:
        """The exact front (k, objectives) where it is known, else None."""
        return None
