"""The one base class of all problems here, over pymoo's `Problem`."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from pymoo.core.problem import Problem

from ..errors import Fault, ModelError
from ..journal import recall_columns
from ..records import Bars, UnitsShown
from ..section import Array, Assumption, Integers, Output, Section, Value, Variable, completed
from .cost_columns import COST, column_interval, column_notes, column_slopes, column_values, weighted_form, with_columns
from .declaration import ConfiguredProblem, Declaration, Interval
from .limits import apart, limits_of, unreachable_limit_faults
from .settings import (
    Bound,
    Promise,
    Settings,
    VariableSetting,
    add_currency,
    assumptions_of,
    few_units_note,
    rising_price_note,
    unit_slips,
)

if TYPE_CHECKING:
    import pandas as pd

    from ..models.capability import PartSample
    from ..models.costs import CostCurve
    from .forms import CostBound, Form

# Full designs of a problem as tables hold them: whole numbers as such, choices by name.


def designs_frame(problem: ToleranceProblem, designs: Array) -> pd.DataFrame:
    """Full designs (n, all variables) as a table holds them, a column per variable."""
    import pandas as pd

    columns: dict[str, Any] = {}
    for variable in problem.variables:
        values = problem.column(designs, variable.name)
        columns[variable.name] = values.astype(np.int64) if variable.integer else values
        if variable.labels:
            columns[variable.name] = np.array(variable.labels, dtype=object)[values.astype(int)]
    return pd.DataFrame(columns)


def designs_of(problem: ToleranceProblem, frame: pd.DataFrame) -> Array:
    """Full designs (n, all variables) of a table as `ToleranceProblem.frame` makes it."""
    columns = [
        frame[variable.name].map({label: at for at, label in enumerate(variable.labels)})
        if variable.labels
        else frame[variable.name]
        for variable in problem.variables
    ]
    return np.asarray(np.stack(columns, axis=1), dtype=float)


MOVED = {
    **{name: name for name in ("variables", "outputs", "parameters", "reference_ga", "sampled")},
    **{f"default_{name}": name for name in ("costs", "limits", "objectives", "model", "algorithm")},
}
"""Attributes of a class that its `declaration` has in their place, and their names there."""


@dataclass(frozen=True, slots=True)
class Variant:
    """A problem with one changed assumption: which one, its new value, and the problem.

    `parts` are the measurements that would settle it, 0 where no measurement does; with `regraded` every grade is
    tried, for assumptions that change which one is best. With `true_costs` it is a change of the costs alone: what
    its allocation costs by those of the problem as it is.
    """

    assumption: str
    value: str
    problem: ToleranceProblem
    parts: int = 0
    regraded: bool = False
    true_costs: bool = False


class ToleranceProblem(Problem):
    """A tolerance allocation problem: some variables are searched, the others fixed.

    A subclass gives its `declaration` and `_outputs`. What else a problem may provide, such as
    derivatives or a convex form, are methods with defaults here, which it replaces.
    Guarded against pymoo's silent failures: objectives are always set, unknown keywords are
    refused, shapes and finiteness are checked, bounds are never reversed.
    """

    declaration: Declaration = Declaration()
    """What a class declares; an object may declare more, such as the choices of machines."""
    _drawn_again: ClassVar[frozenset[str]] = frozenset()
    """Cached attributes that a copy in another process draws or computes again, as they are large.
    """
    _of_searches: ClassVar[frozenset[str]] = frozenset()
    """Those of them that reported points do not need."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        for old, new in MOVED.items():
            if old in vars(cls):
                raise TypeError(f"{cls.__name__}.{old} belongs to its `declaration`, as `{new}`")

    def __init__(self, settings: Settings | None = None) -> None:
        given = settings or Settings()
        self.given = given
        self.settings = self._completed(given)
        money = self.settings.money
        if money.currency:
            priced = tuple(name for name in money.assumed if name in self.settings.costs)
            self.settings = replace(self.settings, money=replace(money, assumed=priced))
            outputs = add_currency(self.outputs, self.settings.money)
            self.declaration = replace(self.declaration, outputs=outputs)
        if self.settings.cost_columns:
            self.declaration = with_columns(self.declaration, self.settings.cost_columns)
        self.objectives = self.settings.objectives
        self.limits = limits_of(self.settings.limits, self.outputs, self.variables)
        set_to = self.settings.variables
        self.fixed: dict[str, float] = {
            v.name: float(value) for v in self.variables if (value := set_to[v.name].value) is not None
        }
        self.free = tuple(v for v in self.variables if v.name not in self.fixed)
        low = np.array([set_to[v.name].low for v in self.free], dtype=float)
        high = np.array([set_to[v.name].high for v in self.free], dtype=float)
        if not np.all(low < high):
            raise ModelError(f"lower bounds must be below upper ones, got {low} and {high}")
        super().__init__(
            n_var=len(self.free),
            n_obj=len(self.objectives),
            n_ieq_constr=sum(limit.count for limit in self.limits),
            xl=low,
            xu=high,
        )

    def __getstate__(self) -> dict[str, Any]:
        """Everything but `_drawn_again`."""
        return {k: value for k, value in self.__dict__.items() if k not in self._drawn_again}

    def release(self, of_searches: bool = False) -> None:
        """Let go of what a problem keeps in memory and draws alike when it is asked again: all of that, or what only
        searches see.
        """
        for name in self._of_searches if of_searches else self._drawn_again:
            self.__dict__.pop(name, None)

    # ------------------------------------------------ what a subclass gives

    @classmethod
    def configured(cls, top: Section) -> ConfiguredProblem | None:
        """The problem of a configuration's tables; None if they are faulty.

        A problem that is written in its configuration reads its own tables here.
        """
        return ConfiguredProblem(cls.declaration, cls)

    @abstractmethod
    def _outputs(self, designs: Array, searching: bool) -> dict[str, Array]:
        """Every output, shape (n,), of designs (n, all variables).

        With `searching` a faster, coarser propagation may be used and errors of estimates omitted.
        """

    def _further(self, designs: Array, searching: bool) -> dict[str, Array]:
        """Outputs (n,) that the settings add to a problem: those of a promise."""
        return {}

    def _verified(self, designs: Array, outputs: Mapping[str, Array]) -> dict[str, Array]:
        """Errors (n,) of the outputs that need a further model, where there are any.

        They are asked for only where designs are reported, not during a search.
        """
        return {}

    def interval(self, output: str) -> Interval:
        """Proven bounds of an output (or variable) over the search space."""
        if output in self.names:
            column = self.names.index(output)
            return float(self.corner(tight=True)[column]), float(self.corner(False)[column])
        if output != COST and output in self.cost_names:
            return column_interval(self, output, self.interval(COST))
        return -np.inf, np.inf

    def box(self) -> tuple[Array, Array]:
        """Ideal and nadir of the normalised hypervolume, fixed by the problem."""
        values = self.objective_values(self.needed_outputs(self._corners()))
        finite = np.isfinite(values).all(axis=1)
        values = values[finite] if finite.any() else np.zeros((1, len(self.objectives)))
        proven = np.array([self.interval(name)[0] for name in self.objectives])
        ideal = np.where(np.isfinite(proven), proven, values.min(axis=0))
        return ideal, apart(ideal, values.max(axis=0))

    def relaxed(self, limits: Mapping[str, Bound]) -> ToleranceProblem:
        """The same problem with some limits replaced."""
        return type(self)(replace(self.given, limits=dict(self.given.limits) | dict(limits)))

    # ------------------------------------------------ set-up

    def _completed(self, given: Settings) -> Settings:
        """The settings with every default filled in."""
        return replace(
            given,
            parameters=completed(self.declaration.parameters, given.parameters),
            variables={v.name: self._variable(v, given.variables.get(v.name)) for v in self.variables},
            costs=dict(self.declaration.costs) | dict(given.costs),
            objectives=given.objectives or self.declaration.objectives,
            limits=dict(self.declaration.limits) | dict(given.limits),
        )

    def _variable(self, variable: Variable, given: VariableSetting | None) -> VariableSetting:
        given = given or VariableSetting()
        mid = variable.mid if given.mid is None else given.mid
        if given.value is not None:
            return replace(given, low=None, high=None, mid=mid)
        low = variable.low if given.low is None else given.low
        return replace(given, low=low, high=variable.high if given.high is None else given.high, mid=mid)

    def assumptions(self) -> tuple[Assumption, ...]:
        """Every default in use that no document prints."""
        return assumptions_of(self)

    def faults(self) -> list[Fault]:
        """What is wrong with the settings as a whole: limits that no design can meet, ..."""
        return self.out_of_reach()

    # ------------------------------------------------ designs and outputs

    @property
    def promise(self) -> Promise | None:
        """The promise of a yield; it sets the limit that keeps it."""
        return self.settings.promise

    @property
    def variables(self) -> tuple[Variable, ...]:
        """All variables, fixed ones included, in the order of a full design."""
        return self.declaration.variables

    @property
    def outputs(self) -> tuple[Output, ...]:
        """All outputs, in the order of a table."""
        return self.declaration.outputs

    @property
    def names(self) -> list[str]:
        """Names of all variables, in the order of a full design."""
        return [v.name for v in self.variables]

    def column(self, designs: Array, name: str) -> Array:
        """One variable (n,) of full designs (n, all variables)."""
        return designs[:, self.names.index(name)]

    def complete(self, x: Array) -> Array:
        """Full designs (n, all variables) of search vectors (n, free variables)."""
        set_to, columns, whole = self._columns
        if self.fixed:
            designs = set_to[None, :].repeat(len(x), axis=0)
            designs[:, columns] = x
        else:
            designs = np.array(x, dtype=float)
        if len(whole):
            designs[:, whole] = np.rint(designs[:, whole])
        return designs

    @cached_property
    def _columns(self) -> tuple[Array, Integers, Integers]:
        """The fixed values of a full design (all,), 0 for its free variables, the columns of the
        free variables, and the columns of whole numbers.
        """
        at = {name: column for column, name in enumerate(self.names)}
        set_to = np.array([self.fixed.get(name, 0.0) for name in self.names])
        free = np.array([at[v.name] for v in self.free], dtype=np.int64)
        whole = np.array([at[v.name] for v in self.variables if v.integer], dtype=np.int64)
        return set_to, free, whole

    def outputs_of(
        self, designs: Array, searching: bool = False, errors: bool = True, known: Mapping[str, Array] | None = None
    ) -> dict[str, Array]:
        """Every output (n,) of full designs (n, all variables), checked for shape.

        Without `errors`, or with `searching`, those of `_verified` stay at zero. Outputs that are
        `known` without errors are not evaluated again.
        """
        designs = np.asarray(designs, dtype=float)
        outputs = dict(known or {})
        if known is None:
            outputs = recall_columns(
                (designs, searching), lambda: self._outputs(designs, searching) | self._further(designs, searching)
            )
        outputs |= self._further_costs(designs, outputs)
        if errors and not searching:
            outputs |= recall_columns((designs, "errors"), lambda: self._verified(designs, outputs))
        for output in self.outputs:
            shape = np.shape(outputs[output.name]) if output.name in outputs else None
            if shape != (len(designs),):
                raise ModelError(f"{output.name}: expected shape ({len(designs)},), got {shape}")
        return outputs

    @cached_property
    def required_outputs(self) -> frozenset[str]:
        """Names of outputs and variables that are minimised or limited."""
        return frozenset((*self.objectives, *(limit.name for limit in self.limits)))

    def values(self, designs: Array, outputs: Mapping[str, Array], name: str) -> Array:
        """An output or variable by name."""
        return outputs[name] if name in outputs else self.column(designs, name)

    def objective_values(self, outputs: Mapping[str, Array]) -> Array:
        """F, shape (n, objectives)."""
        return np.array([outputs[name] for name in self.objectives]).T

    def violations(self, designs: Array, outputs: Mapping[str, Array]) -> Array:
        """G, shape (n, constraints): normalised by the bound, above 0 where a limit is broken."""
        columns = [
            column for limit in self.limits for column in limit.violations(self.values(designs, outputs, limit.name))
        ]
        return np.stack(columns, axis=1) if columns else np.zeros((len(designs), 0))

    def _evaluate(self, x: Array, out: dict[str, Any], *args: Any, failing: bool = False, **kwargs: Any) -> None:
        """F and G of search vectors. Raises ModelError where a value is not finite, unless `failing`."""
        f, g = self.searched(np.atleast_2d(x))
        if not failing:
            self._refuse_failures(x, f, g)
        out["F"] = f
        if self.limits:
            out["G"] = g

    def searched(self, x: Array) -> tuple[Array, Array]:
        """F (n, objectives) and G (n, constraints) of search vectors, as a search sees them; not
        finite where an evaluation fails.
        """
        designs = self.complete(x)
        outputs = self.outputs_of(designs, searching=True)
        return self.objective_values(outputs), self.violations(designs, outputs)

    def _refuse_failures(self, x: Array, *values: Array) -> None:
        """Raises ModelError where a value (n, any number) at search vectors is not finite."""
        for name, columns in zip("FG", values, strict=True):
            if np.count_nonzero(np.isfinite(columns)) < columns.size:
                row = int(np.argmin(np.all(np.isfinite(columns), axis=1)))
                where = dict(zip(self.names, self.complete(np.atleast_2d(x))[row].tolist(), strict=True))
                raise ModelError(f"{name} is not finite at {where}")

    def tested(self, x: Array) -> tuple[Array, Array]:
        """F and G of search vectors as reported: where a search sees a sample, on a fresh one."""
        designs = self.complete(x)
        outputs = self.needed_outputs(designs)
        return self.objective_values(outputs), self.violations(designs, outputs)

    def needed_outputs(self, designs: Array) -> dict[str, Array]:
        """Outputs (n,) of full designs as reported, those of `needed`; recalled."""
        outputs = recall_columns((designs, "needed"), lambda: self.needed(designs))
        return outputs | self._further_costs(np.asarray(designs, dtype=float), outputs)

    def frame(
        self, designs: Array, outputs: Mapping[str, Array] | None = None, searching: bool = False
    ) -> pd.DataFrame:
        """Variables, outputs (at full accuracy) and limit margins of full designs, one row each.

        `outputs` are those of the designs without `errors`, where they are known. With `searching`
        they are as a search evaluates them: coarser, and NaN where it does not need them.
        """
        import pandas as pd

        outputs = self.outputs_of(designs, searching, known=outputs)
        columns: dict[str, Any] = dict(designs_frame(self, designs))
        columns |= {output.name: outputs[output.name] for output in self.outputs}
        for limit in self.limits:
            columns |= limit.margins(self.values(designs, outputs, limit.name))
        frame = pd.DataFrame(columns)
        frame["feasible"] = np.all(self.violations(designs, outputs) <= 0.0, axis=1)
        return frame

    # ------------------------------------------------ cost curves

    def cost_of(self, designs: Array) -> Array:
        """Sum of the cost curves (n,) at full designs."""
        return np.asarray(np.sum(list(self.costs_of(designs).values()), axis=0))

    def costs_of(self, designs: Array) -> dict[str, Array]:
        """What each cost curve (n,) gives at full designs."""
        with np.errstate(divide="ignore"):
            return {name: curve.cost(self.column(designs, name)) for name, curve in self.settings.costs.items()}

    # ------------------------------------------------ further costs (`cost_columns`)

    @property
    def cost_names(self) -> tuple[str, ...]:
        """The columns that are sums of cost curves: `cost`, and the further ones."""
        return (COST, *(column.name for column in self.settings.cost_columns))

    @property
    def priced(self) -> str:
        """The column that bounds are proven of: the first objective among `cost_names`, `cost` before others."""
        return next((name for name in self.cost_names if name in self.objectives), COST)

    @property
    def held_costs(self) -> tuple[str, ...]:
        """The other columns that are minimised or limited from above."""
        limited = {limit.name for limit in self.limits if np.isfinite(limit.high)}
        return tuple(n for n in self.cost_names if n != self.priced and (n in self.objectives or n in limited))

    def _further_costs(self, designs: Array, outputs: Mapping[str, Array]) -> dict[str, Array]:
        if not self.settings.cost_columns:
            return {}
        return column_values(self, designs, outputs[COST] if COST in outputs else self.cost_of(designs))

    def slopes(self, designs: Array) -> dict[str, Array]:
        """`gradient`, and the derivatives of further costs."""
        slopes = self.gradient(designs)
        if not self.settings.cost_columns:
            return slopes
        return dict(slopes) | column_slopes(self, designs, slopes.get(COST, np.zeros_like(designs)))

    def pieces_of(self, name: str) -> int:
        """How often what a variable tolerates is built in, and paid."""
        return 1

    def ranges_of(self, name: str) -> tuple[Interval, ...]:
        """The range of a tolerance in each way of making it."""
        setting = self.settings.variables[name]
        ends = (setting.low, setting.high) if setting.value is None else (setting.value, setting.value)
        return ((float(ends[0] or 0.0), float(ends[1] or 0.0)),)

    def priced_form(self) -> Form | None:
        """The convex form of the column that bounds are proven of."""
        form = self.form()
        return form if form is None or self.priced == COST else self.weighted_form(form, {self.priced: 1.0})

    def weighted_form(self, form: Form, weights: Mapping[str, float]) -> Form | None:
        """The form of a weighted sum of columns from that of the cost; None where it is not known."""
        weighted = weighted_form(self, form, weights)
        if weighted is None or self.priced == COST:
            return weighted
        return replace(weighted, statement=weighted.statement.replace("least cost", f"least {self.priced}"))

    # ------------------------------------------------ corners

    def corner(self, tight: bool) -> Array:
        """The design with every free variable at its lower (tight) or upper bound, (all,)."""
        return np.asarray(self.complete(np.atleast_2d(self.xl if tight else self.xu))[0])

    def _corners(self) -> Array:
        """Designs (k, all variables) whose outputs span the hypervolume's box."""
        return np.stack([self.corner(tight=True), self.corner(tight=False)])

    @cached_property
    def _cost_interval(self) -> Interval:
        """Least and largest cost of the search space: costs fall with every tolerance."""
        ends = np.stack([self.corner(tight=False), self.corner(tight=True)])
        low, high = self.cost_of(ends)
        return float(low), float(high)

    # ------------------------------------------------ the same problem at other accuracies

    def reported(self) -> ToleranceProblem:
        """The same problem at the accuracy that reported points need."""
        return self

    def coarser(self) -> ToleranceProblem:
        """The same problem on a smaller sample, for algorithms that evaluate much."""
        return self

    def finer(self) -> ToleranceProblem:
        """The same problem on a larger sample, on which the points of a search are solved again."""
        return self

    @property
    def fresh_units(self) -> int:
        """Number of units that reported points are tested on, others than those of a search; 0 without such."""
        return 0

    def on_fresh_units(self) -> ToleranceProblem:
        """The same problem whose searches see the units that reported points are tested on, itself without such."""
        return self

    def smooth(self) -> ToleranceProblem:
        """The same problem whose values in a search are smooth, for searches by gradients."""
        return self

    def sample_sizes(self) -> Mapping[str, Value]:
        """Parameters that hold the sizes of its samples at what they are here, whatever the objectives."""
        return {}

    def quantile_units(self) -> Mapping[str, int]:
        """Units of which reported quantiles at the coverage are counted, by the key that states their number."""
        return {}

    def needed(self, designs: Array) -> dict[str, Array]:
        """Outputs (n,) of full designs as reported: at least the cost, and those that objectives
        and limits name.
        """
        return self.outputs_of(designs, errors=False)

    # ------------------------------------------------ derivatives, and where a search by gradients begins

    def gradient(self, designs: Array) -> dict[str, Array]:
        """Derivatives (n, all variables) of the outputs for which the model gives them."""
        return {}

    def cost_slopes(self, designs: Array) -> Array:
        """Derivatives of the cost (n, all variables) at full designs (n, all variables)."""
        slopes = np.zeros_like(designs)
        for name, curve in self.settings.costs.items():
            slopes[:, self.names.index(name)] = curve.slope(self.column(designs, name))
        return slopes

    def starts(self) -> Array:
        """Full designs (k, all variables) that a search by gradients does well to begin from."""
        return np.empty((0, len(self.variables)))

    # ------------------------------------------------ what bounds of the cost are proven with

    def form(self) -> Form | None:
        """The convex form that bounds of the cost are proven with, None where there is none."""
        return None

    def cost_bound(self) -> CostBound | None:
        """Bounds of the cost that need no convex form, None where none are known."""
        return None

    def form_values(self, form: Form, designs: Array, outputs: Mapping[str, Array]) -> Array:
        """True values (n, r) of the requirements of the form, from the outputs of designs.

        With its own limit, a requirement has the value of that limit plus what is missing.
        """
        nothing = np.full(len(designs), -np.inf)
        return np.stack(
            [
                nothing if np.isfinite(most) else self.values(designs, outputs, name)
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

    # ------------------------------------------------ what the documents print

    def references(self) -> dict[str, Array]:
        """Allocations that the documents print, by label: full designs (all variables,)."""
        return {}

    def least_cost(self) -> tuple[str, ToleranceProblem] | None:
        """Label and problem of the documents' single-objective allocation, or None."""
        return None

    # ------------------------------------------------ what a reported allocation is compared with

    def finer_verdicts(self, designs: Array) -> tuple[str, ...]:
        """A finer model's verdict on each full design (n, all variables), such as "by contact this
        allocation keeps 1 arcmin in 43 % of units"; empty where there is none.
        """
        return ()

    def model_labels(self, designs: Array) -> tuple[str, ...]:
        """The model of each full design (n, all variables), and a finer model's verdict.

        Empty texts where there is only one model.
        """
        alone = self.declaration.model_statement
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

    # ------------------------------------------------ how a tolerance stands on a drawing

    def room(self, name: str, design: Array) -> Interval:
        """The range of a variable in which the rest of a full design (all variables,) leaves it."""
        at = [variable.name for variable in self.free].index(name)
        return float(self.xl[at]), float(self.xu[at])

    def zone(self, name: str) -> tuple[float | None, float]:
        """Nominal size of what a variable tolerates, None where it is not known, and the middle of
        its zone as a deviation from it, both in the unit of the variable.
        """
        return None, self.settings.variables[name].mid or 0.0

    def drawn(self, name: str) -> Mapping[str, str]:
        """What the drawing says of the part that a variable tolerates: `class` (g6), `symbol`,
        number of the `drawing` and of the `characteristic`; what is not known is left out.
        """
        return {}

    def curves_of(self, name: str) -> tuple[tuple[CostCurve, float], ...]:
        """The cost curve of a variable and how often it is paid, one for each way of making it.

        Empty where nothing is paid, or where what is paid is no function of the variable alone.
        """
        curve = self.settings.costs.get(name)
        return () if curve is None else ((curve, 1.0),)

    # ------------------------------------------------ what physical effects change

    def counterparts(self) -> tuple[str, ...]:
        """What each active effect does in this problem, in words; empty where it does nothing."""
        return ("",) * len(self.settings.effects)

    def without_effects(self) -> ToleranceProblem:
        """The same problem with no effect in its model."""
        return type(self)(replace(self.given, effects=()))

    def effect_notes(self) -> tuple[str, ...]:
        """A sentence for each active effect, those without a counterpart included."""
        settings = self.settings
        missing = "has no counterpart in this problem: it changes nothing here"
        notes = tuple(
            f"effect {effect.effect.name}: {does}" if does else f"effect {effect.effect.name} {missing}"
            for effect, does in zip(settings.effects, self.counterparts(), strict=True)
        )
        zeros = ", ".join(settings.zero)
        why = "belongs to its instrument: it changes nothing in this problem"
        return (*notes, f"the zero of {zeros} {why}") if zeros else notes

    # ------------------------------------------------ what `tolevo check` reports

    def cautions(self) -> tuple[str, ...]:
        """How the configuration was understood, and what the user should know before a run."""
        settings = self.settings
        slips = map(str, unit_slips(self))
        departures = (
            text
            for variable in self.variables
            if (sample := settings.variables[variable.name].sample)
            for text in sample.departures(variable.name)
        )
        prices = filter(None, (rising_price_note(name, curve) for name, curve in settings.costs.items()))
        coverage = settings.propagation.coverage
        few = filter(None, (few_units_note(key, n, coverage) for key, n in self.quantile_units().items()))
        return (*settings.notes, *slips, *prices, *column_notes(self), *departures, *few, *self.warnings())

    def samples(self) -> tuple[tuple[str, str, PartSample], ...]:
        """Name and unit of each measured quantity, and its sample."""
        return tuple(
            (variable.name, variable.unit, sample)
            for variable in self.variables
            if (sample := self.settings.variables[variable.name].sample)
        )

    def out_of_reach(self) -> list[Fault]:
        """Limits that no design can meet."""
        return unreachable_limit_faults(self)

    def search_faults(self) -> list[Fault]:
        """What is wrong with a search of the problem, though its designs can be evaluated."""
        return []

    def misplaced(self, designs: Array) -> dict[str, dict[int, str]]:
        """Messages, by column and row, on designs that break more than variables' bounds."""
        return {}

    # ------------------------------------------------ what the page of a run shows

    def title(self) -> str:
        """The mechanism in words, for the heading of a page; empty where the name says it."""
        return self.settings.labels.name

    def mechanism(self) -> dict[str, object]:
        """What readers know the mechanism by, for pages, terminal and exports: `name`,
        `description`, `drawing`, as far as they are stated.
        """
        return {**replace(self.settings.labels, name=self.title()).stated()}

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

    def requirements_at(self, design: Array | None = None) -> pd.DataFrame | None:
        """The requirements at one full design (all variables,), by default as they are drawn now, a row
        each: ends, spread, capability and yield, in the columns of `requirements.csv` of an analysis. None
        where a problem has no such table.
        """
        return None

    def remarks(self, front: pd.DataFrame) -> tuple[str, ...]:
        """Remarks on the reported points; `front` has a row for each, as `frame` makes them."""
        return ()

    def validity(self) -> tuple[str, ...]:
        """Limits of validity of the model, a sentence each."""
        return ()

    # ------------------------------------------------ how the problem is written in a configuration

    def tables(self) -> dict[str, Any]:
        """The top-level tables that the problem is written in, where `configured` reads them.

        They take the place of parameters, variables, costs and propagation.
        """
        return {}

    def more_tables(self) -> dict[str, Any]:
        """Top-level tables that `configured` reads in addition to the usual ones."""
        return {}

    # ------------------------------------------------ arrays that a run stores with its results

    def kept(self) -> dict[str, Array]:
        """Arrays by name that took long to compute and depend on the configuration alone."""
        return {}

    def adopt(self, arrays: Mapping[str, Array]) -> bool:
        """Take what another process has `kept`; whether it belongs to this configuration."""
        return False
