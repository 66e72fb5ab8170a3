"""How a value is recomputed: by a calculation, a model, a problem, a formula or a derivative."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import sqrt
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from ...errors import Fault, ModelError, nearest, raise_all
from ...models.effects.measurements import Active, predicted
from ...models.expressions import Formula
from ...models.inputs import Distribution
from ...models.measurable import MeasurableModel
from ...problems.tolerance_problem import ToleranceProblem
from ...section import Array, Output, Parameter, Scalar, Value, completed, number
from ...units import converted
from .records import ComputedTable

__all__ = [
    "STATISTICS",
    "ByCalculation",
    "ByFormula",
    "ByModel",
    "ByProblem",
    "Constant",
    "Derivative",
    "Recipe",
    "Recomputed",
    "Statistic",
]

# What recomputes a figure that is no output of a model or a problem.


@dataclass(frozen=True, slots=True)
class Quantity:
    """A computed number and its unit ("1": none); `standard_error` is 0 where nothing is drawn."""

    value: float
    unit: str
    standard_error: float = 0.0


@dataclass(frozen=True, eq=False)
class Computed:
    """The results of a calculation: numbers by name, and tables for the reader."""

    quantities: Mapping[str, Quantity]
    tables: tuple[ComputedTable, ...] = ()


class Calculation(ABC):
    """A plugin of the entry point group "tolevo.calculations".

    The defaults of `parameters` are the document's case; those that no document prints are marked
    as assumed. It is built without arguments and keeps no state.
    """

    name: ClassVar[str]
    about: ClassVar[str]
    """One sentence: what is computed."""
    reference: ClassVar[str]
    """Where the document has it."""
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    outputs: ClassVar[tuple[Output, ...]] = ()
    """Every quantity that it computes, where they are the same whatever the parameters."""
    sampled: ClassVar[bool] = True
    """Whether it may draw from the generator; if not, it is computed once for all claims."""

    def completed(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """All parameters by name; those left out have their defaults."""
        return completed(self.parameters, values)

    def faults(self, values: Mapping[str, Value]) -> list[Fault]:
        """What is wrong with all parameters together, before anything is computed.

        The place of a fault is the name of a parameter.
        """
        return []

    @abstractmethod
    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        """The quantities at parameters by name (those left out have their defaults).

        Raises InputError where the values do not go together.
        """


# The interface of all recipes.


@dataclass(frozen=True, slots=True, eq=False)
class Recomputed:
    """Computed quantities in the order asked for, and tables by a name for their file."""

    quantities: tuple[Quantity, ...]
    tables: Mapping[str, ComputedTable] = field(default_factory=dict)


class Recipe(ABC):
    """How one or more values are recomputed; a frozen dataclass that can be sent to a process."""

    @abstractmethod
    def recomputed(self, rng: np.random.Generator) -> Recomputed:
        """The values, every random number from `rng`."""

    @property
    @abstractmethod
    def by(self) -> str:
        """What it computes by, in words."""

    def shift_units(self) -> Mapping[str, str | None]:
        """The unit of every input that a derivative may be taken by, None where it is not known."""
        return {}

    def unit_of(self, name: str) -> str | None:
        """Unit of the input `name` that can be shifted, None where there is no such input."""
        return self.shift_units().get(name)

    def shifted(self, name: str, step: float) -> Recipe:
        """The same recipe with an input moved by `step`, in its unit."""
        raise NotImplementedError(f"{type(self).__name__} has no input {name}")


def units_of_numbers(parameters: Iterable[Parameter]) -> dict[str, str | None]:
    """The units of the parameters that are real numbers, by name."""
    return {parameter.name: parameter.unit for parameter in parameters if isinstance(parameter.default, float)}


# Values of a calculation.


MAX_CACHED_RESULTS = 64
"""Results of calculations without chance that a process keeps."""


@dataclass(frozen=True)
class ByCalculation(Recipe):
    """Quantities of a calculation at parameters by name; the defaults are the document's case."""

    kind: type[Calculation]
    parameters: tuple[tuple[str, Value], ...]
    quantities: tuple[str, ...]
    place: str = "quantity"
    """Where the names of the quantities stand, for faults."""

    def recomputed(self, rng: np.random.Generator) -> Recomputed:
        computed = self._computed(rng)
        known = computed.quantities
        raise_all(
            Fault(
                self.place,
                f'"{name}" is not a quantity of {self.kind.name}{nearest(name, known)}; it computes {", ".join(known)}',
            )
            for name in self.quantities
            if name not in known
        )
        tables = {f"{self.kind.name}_{table.name}": table for table in computed.tables}
        return Recomputed(tuple(known[name] for name in self.quantities), tables)

    def _computed(self, rng: np.random.Generator) -> Computed:
        if self.kind.sampled:
            return self.kind().compute(dict(self.parameters), rng)
        return _deterministic_result(self.kind, tuple(map(_hashable, self.parameters)))

    @property
    def by(self) -> str:
        return f"calculation {self.kind.name}"

    def shift_units(self) -> dict[str, str | None]:
        return units_of_numbers(self.kind.parameters)

    def shifted(self, name: str, step: float) -> ByCalculation:
        values = self.kind().completed(dict(self.parameters))
        moved = dict(self.parameters) | {name: number(values[name]) + step}
        return replace(self, parameters=tuple(moved.items()))


Hashable = Scalar | tuple[float, ...] | frozenset[tuple[str, float]]
"""A value that can be a key: a table is the set of its entries."""


def _hashable(item: tuple[str, Value]) -> tuple[str, Hashable]:
    name, value = item
    return name, (frozenset(value.items()) if isinstance(value, Mapping) else value)


@lru_cache(maxsize=MAX_CACHED_RESULTS)
def _deterministic_result(kind: type[Calculation], parameters: tuple[tuple[str, Hashable], ...]) -> Computed:
    """A result that does not depend on random numbers."""
    values: dict[str, Value] = {
        name: dict(value) if isinstance(value, frozenset) else value for name, value in parameters
    }
    return kind().compute(values, np.random.default_rng(0))


# Values of formulas in other recipes' values.


@dataclass(frozen=True, slots=True)
class Constant(Recipe):
    """A number that the document itself prints."""

    value: float
    unit: str

    def recomputed(self, rng: np.random.Generator) -> Recomputed:
        return Recomputed((Quantity(self.value, self.unit),))

    @property
    def by(self) -> str:
        return "printed numbers"


@dataclass(frozen=True)
class ByFormula(Recipe):
    """Formulas in named terms; each term enters in its unit, the results are in `unit`."""

    formulas: tuple[Formula, ...]
    terms: Mapping[str, tuple[Recipe, str]]
    unit: str

    def recomputed(self, rng: np.random.Generator) -> Recomputed:
        values: dict[str, Array] = {}
        errors: dict[str, float] = {}
        tables: dict[str, ComputedTable] = {}
        for stream, (name, (recipe, unit)) in zip(rng.spawn(len(self.terms)), self.terms.items(), strict=True):
            computed = recipe.recomputed(stream)
            (quantity,) = computed.quantities
            values[name] = np.asarray(converted(quantity.value, quantity.unit, unit))
            zero = converted(0.0, quantity.unit, unit)
            errors[name] = converted(quantity.standard_error, quantity.unit, unit) - zero
            tables.update(computed.tables)
        return Recomputed(tuple(self._quantity(formula, values, errors) for formula in self.formulas), tables)

    def _quantity(self, formula: Formula, values: Mapping[str, Array], errors: Mapping[str, float]) -> Quantity:
        value = float(formula.value(values))
        if not np.isfinite(value):
            shown = ", ".join(f"{name} = {float(term):g}" for name, term in values.items())
            raise ModelError(f"{formula.text} has no value at {shown}")
        slopes = formula.gradient(values)
        error = sqrt(sum((float(slope) * errors[name]) ** 2 for name, slope in slopes.items()))
        return Quantity(value, self.unit, error)

    @property
    def by(self) -> str:
        sources = dict.fromkeys(recipe.by for recipe, _ in self.terms.values())
        return f"formula of {', '.join(sources)}" if sources else "formula of printed numbers"


# The standard error of a fraction in a finite sample.


def share_error(fraction: float, count: int) -> float:
    """Standard error of a fraction of `count` draws, never 0.

    Binomial, but at least that of one success in n + 2 (Agresti and Coull, Am. Stat. 52, 1998: a
    sample without a success, or without a failure, does not prove that there is none).
    """
    variance = fraction * (1.0 - fraction) / count
    floor = 1.0 / (count + 2.0)
    return sqrt(max(variance, floor * (1.0 - floor) / (count + 2.0)))


# Statistics of a model's outputs at operating points.


STATISTICS = ("value", "mean", "std", "min", "max", "range", "quantile", "fraction_above", "fraction_below")
"""`value` is that of a single row; `quantile` needs a level, a fraction a threshold."""
FRACTIONS = ("fraction_above", "fraction_below")


@dataclass(frozen=True, slots=True)
class Statistic:
    """A statistic over rows; `at` is the level of a quantile or the threshold of a fraction."""

    name: str = "value"
    at: float = 0.0

    def unit(self, unit: str) -> str:
        """Unit of the statistic of an output in `unit`."""
        return "1" if self.name in FRACTIONS else unit

    def of(self, values: Array) -> float:
        """The statistic of values (n,)."""
        match self.name:
            case "fraction_above":
                return float(np.mean(values > self.at))
            case "fraction_below":
                return float(np.mean(values < self.at))
            case "quantile":
                return float(np.quantile(values, self.at))
            case "range":
                return float(np.ptp(values))
            case "std":
                return float(np.std(values, ddof=1))
            case "mean" | "min" | "max":
                return float(getattr(np, self.name)(values))
            case _:
                return float(values[0])

    def error(self, values: Array) -> float:
        """Standard error where the values are an independent sample; 0 of an extreme or a value.

        That of a quantile is half the width of its 68 % interval between order statistics.
        """
        count = len(values)
        match self.name:
            case "mean":
                return float(np.std(values, ddof=1) / np.sqrt(count))
            case "std":
                centred = values - values.mean()
                variance = np.mean(centred**2)
                return float(np.sqrt((np.mean(centred**4) - variance**2) / (4.0 * variance * count)))
            case "quantile":
                low, high = (int(binom.ppf(level, count, self.at)) for level in (0.1587, 0.8413))
                ordered = np.sort(values)
                return float(0.5 * (ordered[min(high, count - 1)] - ordered[max(low - 1, 0)]))
            case "fraction_above" | "fraction_below":
                return share_error(self.of(values), count)
            case _:
                return 0.0


@dataclass(frozen=True)
class ByModel(Recipe):
    """A statistic of outputs of a model, set up from parameters, designs and distributions.

    `at` holds the operating points: columns (n,), or one value for all rows. `drawn` rows are a
    sample (each with its own random numbers), 0 where nothing is drawn.
    """

    name: str
    kind: type[MeasurableModel]
    parameters: Mapping[str, Value]
    designs: Mapping[str, float]
    inputs: Mapping[str, Distribution]
    effects: tuple[Active, ...]
    at: Mapping[str, tuple[float, ...]]
    outputs: tuple[str, ...]
    statistic: Statistic = Statistic()
    drawn: int = 0

    def model(self) -> MeasurableModel:
        """The model; raises InputError with the faults that only its physics shows."""
        return self.kind(parameters=self.parameters, designs=self.designs, inputs=self.inputs)

    def table(self) -> dict[str, NDArray[Any]]:
        """The operating points; columns of labels number their rows."""
        count = self.drawn or max((len(values) for values in self.at.values()), default=1)
        columns: dict[str, NDArray[Any]] = {
            name: np.broadcast_to(np.array(values, dtype=float), count).copy() for name, values in self.at.items()
        }
        for column in self.kind.columns:
            if column.text and column.needed:
                columns[column.name] = np.arange(count).astype(str)
        return columns

    def recomputed(self, rng: np.random.Generator) -> Recomputed:
        values = predicted(self.model(), self.name, self.table(), self.effects, rng)
        units = {output.name: output.unit for output in self.kind.outputs}
        return Recomputed(
            tuple(
                Quantity(
                    self.statistic.of(values[name]),
                    self.statistic.unit(units[name]) or "1",
                    self.statistic.error(values[name]) if self.drawn else 0.0,
                )
                for name in self.outputs
            )
        )

    @property
    def by(self) -> str:
        return f"model {self.name}"

    def shift_units(self) -> dict[str, str | None]:
        columns = {column.name: column.unit for column in self.kind.columns}
        variables = {variable.name: variable.unit for variable in self.kind.variables}
        return {name: columns.get(name) for name in self.at} | variables | units_of_numbers(self.kind.parameters)

    def shifted(self, name: str, step: float) -> ByModel:
        if name in self.at:
            return replace(self, at=dict(self.at) | {name: tuple(value + step for value in self.at[name])})
        document = {variable.name: float(variable.document or 0.0) for variable in self.kind.variables}
        if name in document:
            return replace(self, designs=dict(self.designs) | {name: (document | dict(self.designs))[name] + step})
        value = number(completed(self.kind.parameters, self.parameters)[name]) + step
        return replace(self, parameters=dict(self.parameters) | {name: value})


# Outputs of a problem at a design.


@dataclass(frozen=True)
class ByProblem(Recipe):
    """Outputs of a problem at one full design, in the order of its variables."""

    name: str
    problem: ToleranceProblem
    design: tuple[float, ...]
    outputs: tuple[str, ...]

    def recomputed(self, rng: np.random.Generator) -> Recomputed:
        whole = self.problem.reported().outputs_of(np.array([self.design]))
        errors = {output.error_of: output.name for output in self.problem.outputs if output.error_of}
        units = {output.name: output.unit for output in self.problem.outputs}
        return Recomputed(
            tuple(
                Quantity(
                    float(whole[name][0]), units[name] or "1", float(whole[errors[name]][0]) if name in errors else 0.0
                )
                for name in self.outputs
            )
        )

    @property
    def by(self) -> str:
        return f"problem {self.name}"

    def shift_units(self) -> dict[str, str | None]:
        variables = {variable.name: variable.unit for variable in self.problem.variables}
        return variables | units_of_numbers(self.problem.declaration.parameters)

    def shifted(self, name: str, step: float) -> ByProblem:
        if name in self.problem.names:
            at = self.problem.names.index(name)
            return replace(self, design=(*self.design[:at], self.design[at] + step, *self.design[at + 1 :]))
        settings = self.problem.given
        parameters = dict(settings.parameters) | {name: number(self.problem.settings.parameters[name]) + step}
        return replace(self, problem=type(self.problem)(replace(settings, parameters=parameters)))


# A sensitivity: the derivative of a recipe by one of its inputs.


@dataclass(frozen=True, slots=True)
class Derivative(Recipe):
    """Central difference of all values of `recipe`, by the input `name`, over +-`step`.

    Both ends take the same random numbers, so that the standard error stated is an upper bound.
    """

    recipe: Recipe
    name: str
    step: float

    def recomputed(self, rng: np.random.Generator) -> Recomputed:
        ends = [
            self.recipe.shifted(self.name, sign * self.step).recomputed(deepcopy(rng)).quantities
            for sign in (1.0, -1.0)
        ]
        per = self.recipe.unit_of(self.name) or "1"
        return Recomputed(
            tuple(
                Quantity(
                    (high.value - low.value) / (2.0 * self.step),
                    high.unit if per == "1" else f"({high.unit})/({per})",
                    float(np.hypot(high.standard_error, low.standard_error)) / (2.0 * self.step),
                )
                for high, low in zip(*ends, strict=True)
            )
        )

    @property
    def by(self) -> str:
        return f"derivative by {self.name} of {self.recipe.by}"
