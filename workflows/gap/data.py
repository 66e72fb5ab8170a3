"""The data of a gap analysis: a checked table in the order of measuring, and its meaning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...arrays import Array
from ...declarations import Output
from ...models.effects import Measurements, Target
from ...models.effects.measurements import SESSION, measurements_of, target_from
from ...models.measurable import Column, Role
from ...units import converted, dimension
from .clocks import in_time
from .plan import GapPlan


@dataclass(frozen=True)
class GapData:
    """Rows (n,) in the order of measuring.

    `measured` holds each output (n,) in its unit, `predicted` the prediction that the table itself
    carries, `std` the noise that it states; `rows` are the line numbers in the file, `blocks` the
    labels of the column that the configuration validates by, `repeats` the label of equal inputs,
    `digest` the SHA-256 of the file, `understood` its interpretation in lines, `table` the same as
    a record.
    """

    target: Target
    measurements: Measurements
    measured: Mapping[str, Array]
    predicted: Mapping[str, Array]
    std: Mapping[str, Array]
    rows: NDArray[np.int64]
    blocks: NDArray[Any] | None = None
    repeats: NDArray[Any] | None = None
    zeros: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    digest: str = ""
    understood: tuple[str, ...] = ()
    table: Mapping[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def outputs(self) -> tuple[Output, ...]:
        """The outputs that were measured."""
        return self.target.outputs

    @property
    def inputs(self) -> tuple[Column, ...]:
        """The input columns that hold numbers and vary."""
        table = self.measurements.table
        return tuple(c for c in self.target.columns if not c.text and np.ptp(table[c.name]) > 0)

    def values(self, name: str) -> Array:
        """Numbers (n,) of a column."""
        return np.asarray(self.measurements.table[name], dtype=float)

    def rows_of(self, output: int) -> slice:
        """The rows of an output among those of all, one output below the other (N,)."""
        return slice(output * len(self), (output + 1) * len(self))

    def stacked(self, by_output: Mapping[str, Array]) -> Array:
        """Values (n,) by output, one output below the other (N,)."""
        return np.concatenate([by_output[o.name] for o in self.outputs])

    def some(self, rows: NDArray[np.int64]) -> GapData:
        """The same data at some of the rows."""
        return replace(
            self,
            measurements=_in_order(measurements_of(self.target.columns, _some(self.measurements.table, rows))),
            measured=_some(self.measured, rows),
            predicted=_some(self.predicted, rows),
            std=_some(self.std, rows),
            rows=self.rows[rows],
            blocks=None if self.blocks is None else self.blocks[rows],
            repeats=None if self.repeats is None else self.repeats[rows],
        )


def _some(values: Mapping[str, NDArray[Any]], rows: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
    return {name: column[rows] for name, column in values.items()}


def assembled(
    plan: GapPlan,
    frame: pd.DataFrame,
    columns: tuple[Column, ...],
    outputs: tuple[Output, ...],
    predictions: Mapping[str, str],
    stds: Mapping[str, str],
    notes: list[str],
) -> GapData:
    """The data from a typed, checked table.

    `predictions` and `stds` name the column of an output; both are brought to the output's unit.
    """
    frame = in_time(frame, columns, notes)
    names = [*(c.name for c in columns), *([SESSION] if SESSION in frame else [])]
    table = {name: frame[name].to_numpy() for name in names}
    units = {o.name: o.unit for o in outputs}
    changeable = () if plan.model is None else plan.model.changeable
    population = plan.model is not None and plan.model.population
    target = target_from(plan.model_name, outputs, columns, table, changeable, population)
    target = replace(target, gear=plan.gear if plan.model is None else plan.model.gear)
    if plan.model is not None:
        target = replace(target, several=len(plan.model.outputs) > 1)
    return GapData(
        target=target,
        measurements=_in_order(measurements_of(columns, table)),
        measured={n: _sense(plan, n) * frame[n].to_numpy(dtype=float) for n in units},
        predicted={
            name: _sense(plan, column) * _converted(frame[column], _unit(plan, column, units[name]), units[name])
            for name, column in predictions.items()
        },
        std={
            name: _converted(frame[column], _unit(plan, column, units[name]), units[name], True)
            for name, column in stds.items()
        },
        rows=frame.index.to_numpy(),
        blocks=None if plan.blocks == "auto" else frame[plan.blocks].to_numpy(),
        repeats=_repeats(frame, columns),
        zeros=_zeros(target),
        notes=tuple(notes),
    )


def _in_order(measurements: Measurements) -> Measurements:
    """Measurements whose rows are in the order of measuring, independent of the clocks of sessions."""
    return replace(measurements, order=None)


def _sense(plan: GapPlan, name: str) -> float:
    """-1 for a column whose sign is opposite to the convention, else 1."""
    declared = plan.columns.get(name)
    return float(plan.sense.get(name, 1) * (1 if declared is None else declared.sense))


def _unit(plan: GapPlan, column: str, unit: str) -> str:
    declared = plan.columns.get(column)
    return unit if declared is None or not declared.unit else declared.unit


def _converted(values: pd.Series[Any], unit: str, wanted: str, scale_only: bool = False) -> Array:
    zero = converted(0.0, unit, wanted) if scale_only else 0.0
    return np.asarray(converted(values.to_numpy(dtype=float), unit, wanted) - zero, dtype=float)


def _repeats(frame: pd.DataFrame, columns: tuple[Column, ...]) -> NDArray[Any] | None:
    """A label of equal inputs, where the table states that measurements were repeated."""
    if not any(c.role is Role.REPEAT for c in columns):
        return None
    same = [c.name for c in columns if c.role not in (Role.TIME, Role.REPEAT)]
    return frame.groupby(same, sort=False, dropna=False).ngroup().to_numpy()


def _zeros(target: Target) -> tuple[str, ...]:
    """The outputs whose zero is always free: angles, twists, transmission errors."""
    angles = tuple(o.name for o in target.outputs if dimension(o.unit) == dimension("rad"))
    return () if target.population else angles
