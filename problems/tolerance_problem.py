"""The one base class of all problems here, over pymoo's `Problem`."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from pymoo.core.problem import Problem

from ..errors import Fault, ModelError
from ..journal import recalled_columns
from ..section import Array, Assumption, Integers, Output, Section, Variable, completed
from .declaration import ConfiguredProblem, Declaration, Interval
from .interfaces import Accuracy, Checks, refuse_lost_members
from .limits import limits_of
from .settings import Bound, Promise, Settings, VariableSetting, assumptions_of, with_currency

# Full designs of a problem as tables hold them: whole numbers as such, choices by name.


def designs_frame(problem: ToleranceProblem, designs: Array) -> pd.DataFrame:
    """Full designs (n, all variables) as a table holds them, a column per variable."""
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


class ToleranceProblem(Problem):
    """A tolerance allocation problem: some variables are searched, the others fixed.

    A subclass gives its `declaration` and `_outputs`; what else it provides, such as derivatives or
    a convex form, belongs to the interfaces of `tolevo.problems.interfaces`, which it inherits.
    Guarded against pymoo's silent failures: objectives are always set, unknown keywords are
    refused, shapes and finiteness are checked, bounds are never reversed.
    """

    declaration: Declaration = Declaration()
    """What a class declares; an object may declare more, such as the choices of machines."""
    _drawn_again: ClassVar[frozenset[str]] = frozenset()
    """Cached attributes that a copy in another process draws or computes again, as they are large.
    """

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        for old, new in MOVED.items():
            if old in vars(cls):
                raise TypeError(f"{cls.__name__}.{old} belongs to its `declaration`, as `{new}`")
        refuse_lost_members(cls)

    def __init__(self, settings: Settings | None = None) -> None:
        given = settings or Settings()
        self.given = given
        self.settings = self._completed(given)
        money = self.settings.money
        if money.currency:
            priced = tuple(name for name in money.assumed if name in self.settings.costs)
            self.settings = replace(self.settings, money=replace(money, assumed=priced))
            outputs = with_currency(self.outputs, self.settings.money)
            self.declaration = replace(self.declaration, outputs=outputs)
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

    # ---------------------------------------------------------------- what a subclass gives

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
            return float(self._corner(tight=True)[column]), float(self._corner(False)[column])
        return -np.inf, np.inf

    def box(self) -> tuple[Array, Array]:
        """Ideal and nadir of the normalised hypervolume, fixed by the problem."""
        values = self.objective_values(self.outputs_of(self._corners(), errors=False))
        finite = np.isfinite(values).all(axis=1)
        values = values[finite] if finite.any() else np.zeros((1, len(self.objectives)))
        proven = np.array([self.interval(name)[0] for name in self.objectives])
        ideal = np.where(np.isfinite(proven), proven, values.min(axis=0))
        return ideal, np.maximum(values.max(axis=0), ideal + 1e-12)

    def relaxed(self, limits: Mapping[str, Bound]) -> ToleranceProblem:
        """The same problem with some limits replaced."""
        return type(self)(replace(self.given, limits=dict(self.given.limits) | dict(limits)))

    # ---------------------------------------------------------------- set-up

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
        return Checks.of(self).out_of_reach()

    # ---------------------------------------------------------------- designs and outputs

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
            outputs = recalled_columns(
                (designs, searching), lambda: self._outputs(designs, searching) | self._further(designs, searching)
            )
        if errors and not searching:
            outputs |= recalled_columns((designs, "errors"), lambda: self._verified(designs, outputs))
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
        outputs = Accuracy.of(self).needed(designs)
        return self.objective_values(outputs), self.violations(designs, outputs)

    def frame(
        self, designs: Array, outputs: Mapping[str, Array] | None = None, searching: bool = False
    ) -> pd.DataFrame:
        """Variables, outputs (at full accuracy) and limit margins of full designs, one row each.

        `outputs` are those of the designs without `errors`, where they are known. With `searching`
        they are as a search evaluates them: coarser, and NaN where it does not need them.
        """
        outputs = self.outputs_of(designs, searching, known=outputs)
        columns: dict[str, Any] = dict(designs_frame(self, designs))
        columns |= {output.name: outputs[output.name] for output in self.outputs}
        for limit in self.limits:
            columns |= limit.margins(self.values(designs, outputs, limit.name))
        frame = pd.DataFrame(columns)
        frame["feasible"] = np.all(self.violations(designs, outputs) <= 0.0, axis=1)
        return frame

    # ---------------------------------------------------------------- cost curves

    def cost_of(self, designs: Array) -> Array:
        """Sum of the cost curves (n,) at full designs."""
        return np.asarray(np.sum(list(self.costs_of(designs).values()), axis=0))

    def costs_of(self, designs: Array) -> dict[str, Array]:
        """What each cost curve (n,) gives at full designs."""
        with np.errstate(divide="ignore"):
            return {name: curve.cost(self.column(designs, name)) for name, curve in self.settings.costs.items()}

    # ---------------------------------------------------------------- corners

    def _corner(self, tight: bool) -> Array:
        """The design with every free variable at its lower (tight) or upper bound, (all,)."""
        return np.asarray(self.complete(np.atleast_2d(self.xl if tight else self.xu))[0])

    def _corners(self) -> Array:
        """Designs (k, all variables) whose outputs span the hypervolume's box."""
        return np.stack([self._corner(tight=True), self._corner(tight=False)])

    @cached_property
    def _cost_interval(self) -> Interval:
        """Least and largest cost of the search space: costs fall with every tolerance."""
        ends = np.stack([self._corner(tight=False), self._corner(tight=True)])
        low, high = self.cost_of(ends)
        return float(low), float(high)
