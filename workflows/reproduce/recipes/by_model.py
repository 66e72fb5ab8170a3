"""Statistics of a model's outputs at operating points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from ....arrays import Array
from ....declarations import Value, completed, number
from ....models.effects.compose import Active, predicted
from ....models.inputs.distribution import Distribution
from ....models.measurable import MeasurableModel
from ..calculation import Quantity
from ..sampling import share_error
from .recipe import Recipe, Recomputed, continuous

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
        return {name: columns.get(name) for name in self.at} | variables | continuous(self.kind.parameters)

    def shifted(self, name: str, step: float) -> ByModel:
        if name in self.at:
            return replace(self, at=dict(self.at) | {name: tuple(value + step for value in self.at[name])})
        document = {variable.name: float(variable.document or 0.0) for variable in self.kind.variables}
        if name in document:
            return replace(self, designs=dict(self.designs) | {name: (document | dict(self.designs))[name] + step})
        value = number(completed(self.kind.parameters, self.parameters)[name]) + step
        return replace(self, parameters=dict(self.parameters) | {name: value})
