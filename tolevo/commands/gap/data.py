"""The data of a gap analysis: a checked table in the order of measuring, its clocks, and units as a batch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...errors import Fault
from ...models.effects import Measurements, Target
from ...models.effects.measurements import SESSION, has_session_clocks, measurements_of, target_from
from ...models.measurable import Column, Role
from ...section import Array, Output
from ...units import converted, dimension
from .plan import GapPlan

LATE = 0.05
"""Fraction of its span by which the start of a clock may differ from 0."""
COPIES = 0.1
"""Fraction of the rows up to which measurements in steps may repeat one another by chance."""
MAX_BACKSTEP_FRACTION = 0.02
"""Fraction of a session's rows up to which a clock that goes back was reset; above it the rows are
in disorder."""


def sort_by_time(frame: pd.DataFrame, columns: Sequence[Column], notes: list[str]) -> pd.DataFrame:
    """The rows in the order of measuring: by the clock, or by session where each has a clock."""
    time = clock_of(columns, frame)
    if time is None:
        return frame
    separate_clocks = SESSION in frame and has_session_clocks(
        frame[SESSION].to_numpy(), frame[time].to_numpy(dtype=float)
    )
    steps = _steps(frame, time, separate_clocks)
    if count := int((steps < 0).sum()):
        notes.append(f"{time} goes back {count} times; the rows were put in the order of {time}")
        frame = _sort_rows(frame, time, separate_clocks)
        steps = _steps(frame, time, separate_clocks)
    if separate_clocks:
        notes.append(
            f"{time} starts again in each {SESSION}: rows are in the order of the sessions "
            "in the file, and effects of time refer to the start of their session"
        )
    if same := int((steps == 0).sum()):
        notes.append(f"{time} does not advance at {same} rows: their order is that of the file")
    usual = float(np.median(steps)) if len(steps) else 0.0
    if usual > 0 and (gaps := int((steps > 10 * usual).sum())):
        notes.append(f"{time} is broken by {gaps} gaps of more than 10 usual steps")
    return frame


def clock_of(columns: Sequence[Column], frame: pd.DataFrame) -> str | None:
    """The column of the time, None where there is none."""
    return next((c.name for c in columns if c.role is Role.TIME and c.name in frame), None)


def late_clock_messages(frame: pd.DataFrame, columns: Sequence[Column]) -> list[str]:
    """Messages about clocks that do not begin near 0, from where effects count the time."""
    clocks = [(c, frame[c.name].to_numpy(dtype=float)) for c in columns if c.role is Role.TIME and c.name in frame]
    return [
        f"{c.name} begins at {t.min():g} {c.unit}: wear and creep are counted from 0; subtract the value at the start"
        for c, t in clocks
        if abs(t.min()) > LATE * np.ptp(t)
    ]


def copied_rows_messages(frame: pd.DataFrame) -> list[str]:
    """A message where many rows are others again, as files that were joined twice have them: each counts as a
    measurement of its own.
    """
    copies = int(frame.duplicated().sum())
    if copies <= COPIES * len(frame):
        return []
    return [
        f"{copies} of {len(frame)} rows are others again, the measured values included: if they are copies, remove "
        "them, as each counts as a measurement and makes the intervals narrower"
    ]


def clock_faults(frame: pd.DataFrame, columns: Sequence[Column], place: str) -> list[Fault]:
    """Sessions in which the clock was reset: they have two clocks, whose order is unknown."""
    time = clock_of(columns, frame)
    if time is None or SESSION not in frame:
        return []
    faults = []
    for label, part in frame.groupby(SESSION, sort=False):
        t = part[time].to_numpy(dtype=float)
        back = np.flatnonzero(np.diff(t) < 0.0) + 1
        if 0 < len(back) <= max(1.0, MAX_BACKSTEP_FRACTION * len(t)):
            rows = ", ".join(str(part.index[at]) for at in back[:5])
            text = (
                f"is set back within {SESSION} {label}, at row {rows}: a session has one clock; give the "
                f"rows that follow a separate {SESSION}, or use one time for the whole record"
            )
            faults.append(Fault(f"{place}: column {time}", text))
    return faults


def _steps(frame: pd.DataFrame, time: str, separate_clocks: bool) -> NDArray[Any]:
    """Steps of the clock from row to row, within sessions where each has its own."""
    steps = np.diff(frame[time].to_numpy(dtype=float))
    if not separate_clocks:
        return steps
    label = frame[SESSION].to_numpy()
    return np.asarray(steps[label[1:] == label[:-1]])


def _sort_rows(frame: pd.DataFrame, time: str, separate_clocks: bool) -> pd.DataFrame:
    if not separate_clocks:
        return frame.sort_values(time, kind="stable")
    number = pd.Series(pd.factorize(frame[SESSION])[0], index=frame.index)
    return frame.assign(_number=number).sort_values(["_number", time], kind="stable").drop(columns="_number")


NUMBERING = (Role.TIME, Role.REPEAT, Role.UNIT, Role.LOT)
"""Roles of columns that number or date the rows: rows to come are always beyond theirs."""


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

    @property
    def ranges(self) -> dict[str, list[float]]:
        """The least and largest value of each input, but of those that number or date the rows."""
        table = self.measurements.table
        columns = [c.name for c in self.target.columns if not c.text and c.role not in NUMBERING and c.name in table]
        return {name: [float(np.min(table[name])), float(np.max(table[name]))] for name in columns}

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
            measurements=_order_measurements(
                measurements_of(self.target.columns, _select_rows(self.measurements.table, rows))
            ),
            measured=_select_rows(self.measured, rows),
            predicted=_select_rows(self.predicted, rows),
            std=_select_rows(self.std, rows),
            rows=self.rows[rows],
            blocks=None if self.blocks is None else self.blocks[rows],
            repeats=None if self.repeats is None else self.repeats[rows],
        )


def _select_rows(values: Mapping[str, NDArray[Any]], rows: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
    return {name: column[rows] for name, column in values.items()}


def assemble_data(
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
    frame = sort_by_time(frame, columns, notes)
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
        measurements=_order_measurements(measurements_of(columns, table)),
        measured={n: _sense(plan, n) * frame[n].to_numpy(dtype=float) for n in units},
        predicted={
            name: _sense(plan, column) * _convert_values(frame[column], _unit(plan, column, units[name]), units[name])
            for name, column in predictions.items()
        },
        std={
            name: _convert_values(frame[column], _unit(plan, column, units[name]), units[name], True)
            for name, column in stds.items()
        },
        rows=frame.index.to_numpy(),
        blocks=None if plan.blocks == "auto" else frame[plan.blocks].to_numpy(),
        repeats=_repeats(frame, columns),
        zeros=_zeros(target),
        notes=tuple(notes),
    )


def _order_measurements(measurements: Measurements) -> Measurements:
    """Measurements whose rows are in the order of measuring, independent of the clocks of sessions."""
    return replace(measurements, order=None)


def _sense(plan: GapPlan, name: str) -> float:
    """-1 for a column whose sign is opposite to the convention, else 1."""
    declared = plan.columns.get(name)
    return float(plan.sense.get(name, 1) * (1 if declared is None else declared.sense))


def _unit(plan: GapPlan, column: str, unit: str) -> str:
    declared = plan.columns.get(column)
    return unit if declared is None or not declared.unit else declared.unit


def _convert_values(values: pd.Series[Any], unit: str, wanted: str, scale_only: bool = False) -> Array:
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


SEVERAL = 3
"""Least number of units of a model of single units, each perhaps under several conditions."""
MIN_UNITS = 12
"""Rows, or units of a batch, below which nothing is distinguishable from noise."""


def number_units(cells: pd.DataFrame, columns: Sequence[Column], place: str, notes: list[str]) -> pd.DataFrame:
    """The cells with a number for each unit. Labels such as RG20-1203 are numbered in their order
    unless the model takes names; without a column of units every row is a unit.
    """
    unit = next((c for c in columns if c.role is Role.UNIT), None)
    if unit is None or not len(cells):
        return cells
    name = unit.name
    if name not in cells:
        notes.append(f"{place}: no column {name}: each row counts as a separate unit")
        number = np.arange(1, len(cells) + 1)
        return cells.assign(**{name: number.astype(str) if unit.text else number})
    if unit.text:
        return cells
    labels = cells[name].astype(object)
    filled = labels[labels.notna() & (labels.astype(str) != "")]
    if pd.to_numeric(filled, errors="coerce").notna().all():
        return cells
    number, names = pd.factorize(filled)
    notes.append(f"{place}: {len(names)} labels of units ({names[0]}, ...) are numbered in the order of the rows")
    return cells.assign(**{name: pd.Series(number + 1, index=filled.index).reindex(cells.index)})


def average_repeats(
    frame: pd.DataFrame, columns: Sequence[Column], place: str, notes: list[str]
) -> tuple[pd.DataFrame, list[Fault]]:
    """The table with one row per unit, the mean of its repeats; a fault where units are too few.

    Units are distinguished by the columns of unit and lot. A row keeps the line number of the
    unit's first measurement. Without a column of repeats every row is a unit.
    """
    labels = [c.name for c in columns if c.role in (Role.UNIT, Role.LOT) and c.name in frame]
    if not labels:
        return frame, []
    if faults := _repeated_unit_faults(frame, columns, place):
        return frame, faults
    number = frame.groupby(labels, sort=False, dropna=False).ngroup().to_numpy()
    units, rows = len(np.unique(number)), len(frame)
    if units < MIN_UNITS:
        needs = f"a batch needs at least {MIN_UNITS} units"
        return frame, [Fault(place, f"holds {units} units in {rows} rows: cannot tell with n = {units}; {needs}")]
    repeat = next((c.name for c in columns if c.role is Role.REPEAT and c.name in frame), None)
    if units < rows and repeat is None:
        notes.append(
            f"{rows - units} rows repeat the label of a unit: each counts as a separate unit; a "
            "column repeat states that a unit was measured again"
        )
    if repeat is None:
        return frame, []
    if units < rows:
        notes.append(f"{rows} measurements of {units} units: each unit is the mean of its measurements")
    merged = frame.drop(columns=repeat).groupby(number, sort=True)
    means = merged.agg({name: "first" if name in labels else "mean" for name in frame.columns if name != repeat})
    return means.set_axis(frame.index[~pd.Series(number).duplicated().to_numpy()]), []


def _repeated_unit_faults(frame: pd.DataFrame, columns: Sequence[Column], place: str) -> list[Fault]:
    """Faults of columns that make a row one of many measurements of a unit, which have no law."""
    text = (
        "a batch is compared by one measurement of each unit: give the largest (or the mean) of its "
        "measurements, set [parameters] positions to their number, and remove this column"
    )
    inputs = (c.name for c in columns if of_one_measurement(c) and c.name in frame)
    return [Fault(f"{place}: column {name}", text) for name in inputs]


def of_one_measurement(column: Column) -> bool:
    """Whether a column distinguishes measurements of a unit, so that a batch must not have it."""
    return column.role is Role.INPUT


def too_few_units_fault(frame: pd.DataFrame, columns: Sequence[Column], place: str) -> list[Fault]:
    """A fault where a model that needs the units' labels has only one or two units."""
    name = next((c.name for c in columns if c.role is Role.UNIT and c.needed), None)
    if name is None or name not in frame or frame.empty:
        return []
    units = frame[name].nunique()
    text = f"holds {units} units in {len(frame)} rows: cannot tell with n = {units}; give at least {SEVERAL} units"
    return [Fault(place, text)] if units < SEVERAL else []
