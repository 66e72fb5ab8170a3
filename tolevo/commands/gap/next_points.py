"""Operating points of a possible next measurement, and cycles of the torque, inside all ranges."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...models.measurable import Column, MeasurableModel, Role
from ...section import Array
from .data import GapData
from .plan import Span

Table = Mapping[str, NDArray[Any]]
RANGE = "next_measurement.range"
NO_POINT = "contains no point that the model reaches; widen it"
INSIDE = 9
"""Number of points of the Sobol sequence inside the box, as a power of two."""
CORNERS = 6
"""Number of inputs up to which every corner of the box is a candidate."""
VISITED = 256
"""Largest number of points of the record that are candidates as well."""
TURNS = 0.01
"""Fraction of the largest load below which its sign is uncertain."""
DIGITS = 4
"""Decimal places of a point, relative to its range."""


@dataclass(frozen=True)
class Axis:
    """An input of the design, and its range."""

    column: Column
    span: Span

    def at(self, fractions: Array) -> Array:
        """Values (n,) at fractions (n,) of its range."""
        if self.span.values:
            steps = (fractions * len(self.span.values)).astype(np.int64)
            return np.asarray(self.span.values)[np.minimum(steps, len(self.span.values) - 1)]
        return self.settable(self.span.low + fractions * (self.span.high - self.span.low))

    def settable(self, values: Array) -> Array:
        """Values (n,) rounded to settable ones, within the range."""
        if self.span.values:
            return values
        low, high = self.span.low, self.span.high
        places = DIGITS - int(np.floor(np.log10(max(high - low, 1e-300)))) - 1
        return np.asarray(np.clip(np.round(values, max(places, 0)), low, high))


def axes_of(data: GapData, ranges: Mapping[str, Span], count: int) -> tuple[Axis, ...]:
    """Every numeric input: in its configured range, else in that of the data."""
    return tuple(
        Axis(column, _span(data, column, ranges.get(column.name), count))
        for column in data.target.columns
        if not column.text and column.role is not Role.REPEAT
    )


def _span(data: GapData, column: Column, wanted: Span | None, count: int) -> Span:
    """The range of a column; times that are past are excluded."""
    now = _current_range(data, column, count)
    if wanted is None:
        return now
    if column.role is Role.TIME:
        return Span(min(max(wanted.low, now.low), wanted.high), wanted.high)
    return wanted


def _current_range(data: GapData, column: Column, count: int) -> Span:
    """The range of the data; time continues by one usual step per measurement."""
    values = data.values(column.name)
    low, high = float(values.min()), float(values.max())
    if column.role is Role.TIME:
        step = usual_step(values)
        return Span(high + step, high + count * step)
    if column.role is Role.DIRECTION:
        return Span(low, high, tuple(np.unique(values).tolist()))
    return Span(low, high)


def usual_step(times: Array) -> float:
    """The median step of a clock (n,)."""
    return float(np.median(np.diff(times))) if len(times) > 1 else 1.0


def candidates(data: GapData, axes: Sequence[Axis], seed: int) -> Table:
    """A table of points that cover the box of these axes, its corners and edges, and points of the
    record inside it.
    """
    moving = [axis for axis in axes if axis.span.high > axis.span.low]
    fractions = np.vstack([_interior_points(len(moving), seed), _corners(len(moving)), _edges(len(moving))])
    table = {axis.column.name: np.full(len(fractions), axis.span.low) for axis in axes}
    table |= {axis.column.name: axis.at(fractions[:, at]) for at, axis in enumerate(moving)}
    visited = _points_of_record(data, axes)
    return add_label_columns(data, {n: np.concatenate([v, visited[n]]) for n, v in table.items()})


def add_label_columns(data: GapData, table: Table) -> dict[str, NDArray[Any]]:
    """The table with the columns of labels: new units, known lots, and the next repeat's number."""
    count = len(next(iter(table.values()))) if table else 1
    labelled: dict[str, NDArray[Any]] = dict(table)
    for column in data.target.columns:
        values = data.measurements.table[column.name]
        if column.role is Role.UNIT:
            labelled[column.name] = np.array([f"next {k + 1}" for k in range(count)])
        elif column.role is Role.REPEAT:
            labelled[column.name] = np.full(count, float(np.max(values)) + 1.0)
        elif column.text:
            labelled[column.name] = np.resize(np.unique(values.astype(str)), count)
    return {c.name: labelled[c.name] for c in data.target.columns}


def rows_in_range(model: MeasurableModel | None, table: Table) -> NDArray[np.bool_]:
    """Rows (n,) of a table that are in the range of the model; missing columns are unknown."""
    count = len(next(iter(table.values())))
    within = np.ones(count, dtype=bool)
    if model is not None:
        unknown = {c.name: np.full(count, np.nan) for c in model.columns if not c.text}
        for wrong, _ in model.outside({**unknown, **table}).values():
            within &= ~wrong
    return within


def near_load_reversal(axes: Iterable[Axis], table: Table) -> NDArray[np.bool_]:
    """Points (n,) where a load is close to a change of sign: a jump of a formula there is blurred
    in reality, and so is the load that can be set.
    """
    turns = np.zeros(len(next(iter(table.values()))), dtype=bool)
    for axis in axes:
        if axis.column.role in (Role.TORQUE, Role.FORCE):
            most = max(abs(axis.span.low), abs(axis.span.high))
            turns |= np.abs(table[axis.column.name]) < TURNS * most
    return turns


def _interior_points(inputs: int, seed: int) -> Array:
    if inputs == 0:
        return np.zeros((1, 0))
    sobol = scipy.stats.qmc.Sobol(inputs, rng=np.random.default_rng([seed, 8]))
    return np.asarray(sobol.random_base2(INSIDE + (inputs > 3)))


def _corners(inputs: int) -> Array:
    """Corners of the unit box, those of pairs of inputs where there are too many."""
    if inputs <= CORNERS:
        return np.array(list(product((0.0, 1.0), repeat=inputs))).reshape(2**inputs, inputs)
    pairs = [(i, j, a, b) for i in range(inputs) for j in range(i) for a in (0.0, 1.0) for b in (0.0, 1.0)]
    points = np.full((len(pairs), inputs), 0.5)
    for row, (i, j, a, b) in zip(points, pairs, strict=True):
        row[i], row[j] = a, b
    return points


def _edges(inputs: int) -> Array:
    """Each input from end to end, the others in the middle or at one end together."""
    steps = np.linspace(0.0, 1.0, 17)
    lines = [np.zeros((0, inputs))]
    for at, level in product(range(inputs), (0.0, 0.5, 1.0)):
        lines.append(np.full((len(steps), inputs), level))
        lines[-1][:, at] = steps
    return np.vstack(lines)


def _points_of_record(data: GapData, axes: Sequence[Axis]) -> dict[str, Array]:
    """Points of the record that lie in the box, evenly along it."""
    table = {axis.column.name: data.values(axis.column.name) for axis in axes}
    within = np.ones(len(data), dtype=bool)
    for axis in axes:
        values = table[axis.column.name]
        if axis.column.role is Role.TIME:
            table[axis.column.name] = np.full(len(data), axis.span.low)
        elif axis.span.values:
            within &= np.isin(values, axis.span.values)
        else:
            within &= (values >= axis.span.low) & (values <= axis.span.high)
    rows = np.flatnonzero(within)
    rows = rows[:: max(1, -(-len(rows) // VISITED))]
    return {axis.column.name: axis.settable(table[axis.column.name][rows]) for axis in axes}


CYCLES = 7
"""Number of cycles that are tried, as a power of two."""
PER_CYCLE = 20
"""Number of measurements of a cycle."""
LOCKED = "rv_lost_motion"
PATH = Column("repeat", "", "number of the cycle", False, role=Role.REPEAT)


def depends_on_path(data: GapData) -> bool:
    """Whether measurements depend on the path of the load."""
    return data.target.model == LOCKED


def divide_into_cycles(total: int) -> tuple[int, int]:
    """The number of cycles, and of measurements in each, that give about `total` measurements."""
    count = max(1, round(total / PER_CYCLE))
    return count, max(total // count, 1)


def cycles(data: GapData, axes: Sequence[Axis], rows: int, seed: int) -> Table:
    """A table of cycles of so many rows: the torque from its lower end to its upper one and back,
    other inputs constant in a cycle; the first cycles take the whole range, or one side of it.
    """
    moving = [axis for axis in axes if axis.column.role not in (Role.TORQUE, Role.DIRECTION)]
    ends, other_fractions = _draw_cycles(len(moving), seed)
    torque = next(axis for axis in axes if axis.column.role is Role.TORQUE)
    low, high = torque.at(ends[:, 0]), torque.at(ends[:, 1])
    fraction = (np.arange(rows) + 1.0) / rows
    wave = 1.0 - np.abs(2.0 * fraction - 1.0)
    table = {torque.column.name: (low[:, None] + (high - low)[:, None] * wave).ravel()}
    for at, axis in enumerate(moving):
        table[axis.column.name] = np.repeat(axis.at(other_fractions[:, at]), rows)
    for axis in axes:
        if axis.column.role is Role.DIRECTION:
            table[axis.column.name] = np.tile(np.where(fraction <= 0.5, 1.0, -1.0), len(ends))
    return {**add_label_columns(data, table), PATH.name: np.repeat(np.arange(len(ends), dtype=float), rows)}


def _draw_cycles(other_inputs: int, seed: int) -> tuple[Array, Array]:
    """Lower and upper ends of the torque (C, 2) and fractions (C, others) of the other inputs."""
    sobol = scipy.stats.qmc.Sobol(2 + other_inputs, rng=np.random.default_rng([seed, 9]))
    fractions = np.asarray(sobol.random_base2(CYCLES))
    ends = np.sort(fractions[:, :2], axis=1)
    ends[:32], ends[32:48, 0], ends[48:64, 1] = (0.0, 1.0), 0.0, 1.0
    return ends, fractions[:, 2:]
