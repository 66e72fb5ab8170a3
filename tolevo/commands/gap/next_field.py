"""Candidate points of a next measurement: inside all ranges, predictions there, contests of explanations,
designs by exchange.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import refuse
from ...models.effects.measurements import SESSION, measurements_of, usual_step
from ...models.measurable import Column, MeasurableModel, Role
from ...section import Array
from .data import GapData
from .fit import Fit, Fitter, Space
from .library import Candidate, Columns, Predict, predictor
from .linear import TIE, basis, project_out
from .noise import Noise
from .plan import NextPlan, Span
from .setup import Setup, change_of, zeros_of

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
        step = usual_step(values, 1.0)
        return Span(high + step, high + count * step)
    if column.role is Role.DIRECTION:
        return Span(low, high, tuple(np.unique(values).tolist()))
    return Span(low, high)


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


# Predictions of a fit there.


STRIDE = 0.02
"""Fraction of a nonlinear parameter by which it is moved for its column."""


def place_at_rows(data: GapData, table: Table, more: tuple[Column, ...] = ()) -> GapData:
    """The data's columns, and `more` ones, at the rows of a table, nothing measured there."""
    count = len(next(iter(table.values())))
    target = replace(data.target, columns=(*data.target.columns, *more))
    return replace(
        data,
        target=target,
        measurements=measurements_of(target.columns, table),
        measured={},
        predicted={},
        std={},
        rows=np.arange(count),
        repeats=None,
        blocks=None,
    )


def columns_at(setup: Setup, data: GapData) -> Columns:
    """Columns of effects at rows where nothing was measured."""
    plan = setup.plan
    if plan.model is None:
        return Columns(data, zero_prediction(data))
    moved = plan.rebuild(setup.at) if plan.rebuild and setup.at else None
    return Columns(data, predictor(plan, data, moved))


def base_at(setup: Setup, data: GapData) -> Array:
    """Columns (N, p) of the free parameters, each for its whole tolerance, and of the zeros."""
    changes = [change_of(setup.plan, data, setup.at, name) for name in setup.free]
    return np.column_stack([*changes, zeros_of(data)])


def zero_prediction(data: GapData) -> Predict:
    """The prediction 0 of every output, at rows for which a table has none."""
    zero = {o.name: np.zeros(len(data)) for o in data.outputs}
    return lambda changes: zero


@dataclass(frozen=True)
class Predictions:
    """The prediction (N,) of a fit at N rows, and the columns (N, p) of all that is fitted in it:
    free parameters, zeros, effects, and the derivatives by their nonlinear parameters.
    """

    values: Array
    columns: Array


def predictions(columns: Columns, base: Array, fit: Fit) -> Predictions:
    """The prediction of a fit at the rows of `columns`, in the outputs' units."""
    values, parts = base @ fit.free, [base]
    for member, coefficients in zip(fit.members, fit.coefficients, strict=True):
        member_columns = columns.of(member.candidate, member.shape)
        values = values + member_columns @ coefficients
        if not member.candidate.is_nonlinear:
            parts.append(member_columns)
        for parameter in (p for p in member.candidate.shape if not p.choices):
            value = member.shape[parameter.name]
            step = STRIDE * (abs(value) or 1.0)
            ends = max(value - step, parameter.low), min(value + step, parameter.high)
            low, high = (columns.of(member.candidate, {**member.shape, parameter.name: end}) for end in ends)
            parts.append(((high - low) @ coefficients / max(ends[1] - ends[0], 1e-300))[:, None])
    return Predictions(np.asarray(values), np.hstack(parts))


def predict_record(fitter: Fitter, fit: Fit) -> Predictions:
    """The prediction of a fit at the N whitened rows of the record, followed by the tolerances."""
    prediction = predictions(fitter.columns, fitter.raw_base, fit)
    free = fitter.base.shape[1]
    columns = fitter.space.whiten(prediction.columns)
    columns[:, :free] = fitter.base
    values = fitter.space.whiten(prediction.values)
    tail = slice(len(values) - fitter.space.prior, None)
    values[tail] = fitter.base[tail] @ fit.free
    return Predictions(values, columns)


def distance(explanation: Predictions, rival: Predictions) -> float:
    """Squared norm of the difference of two predictions outside the span of the rival's columns."""
    return float(np.sum(project_out(explanation.values - rival.values, basis(rival.columns)) ** 2))


# The discrimination of two explanations by measurements at some points and those of the record.
#
# The criterion is that of T-optimality: the squared norm of the residual of the one prediction after
# a refit of the other. Reference: Atkinson & Fedorov, Biometrika 62, 1975.

RIDGE = 1e-10
"""Fraction of a column's square that keeps a fit regular."""
Chosen = NDArray[np.int64]


@dataclass(frozen=True)
class Contest:
    """An explanation against a rival, in noise units. `gram` (p, p), `cross` (p,) and `square` are
    the rival's normal equations at the record; `residual` (C, k) is the residual of the explanation
    given the rival at C candidates of k measurements, `columns` (C, k, p) are the rival's.
    """

    gram: Array
    cross: Array
    square: float
    residual: Array
    columns: Array

    @classmethod
    def of(
        cls, record: tuple[Predictions, Predictions], points: tuple[Predictions, Predictions], count: int
    ) -> Contest:
        """The contest from both predictions at the record and at candidates of `count` measurements,
        all whitened; the rows of a candidate are adjacent.
        """
        explanation, rival = record
        square = np.sum(rival.columns**2, axis=0) + np.sum(points[1].columns ** 2, axis=0)
        kept = square > 0.0
        scale = 1.0 / np.sqrt(square[kept])
        x, new = rival.columns[:, kept] * scale, points[1].columns[:, kept] * scale
        y = explanation.values - rival.values
        start, *_ = np.linalg.lstsq(x, y, rcond=1e-9)
        y, residual = y - x @ start, points[0].values - points[1].values - new @ start
        return cls(
            gram=x.T @ x + RIDGE * np.eye(len(scale)),
            cross=x.T @ y,
            square=float(y @ y),
            residual=residual.reshape(-1, count),
            columns=new.reshape(-1, count, len(scale)),
        )

    def level(self, chosen: Chosen) -> tuple[float, Array, Array]:
        """Discrimination with these candidates, the rival's coefficients (p,), and the inverse
        (p, p) of its normal equations.
        """
        x = self.columns[chosen].reshape(-1, self.columns.shape[2])
        y = self.residual[chosen].ravel()
        inverse = np.asarray(np.linalg.inv(self.gram + x.T @ x), dtype=np.float64)
        cross = self.cross + x.T @ y
        coefficients = inverse @ cross
        return max(self.square + float(y @ y) - float(cross @ coefficients), 0.0), coefficients, inverse

    def with_each(self, chosen: Chosen) -> Array:
        """Discrimination (C,) with these candidates and each one in addition."""
        level, coefficients, inverse = self.level(chosen)
        residual = self.residual - self.columns @ coefficients
        spread = self.columns @ inverse
        if residual.shape[1] == 1:
            lever = np.einsum("ckp,ckp->c", spread, self.columns)
            return np.asarray(level + residual[:, 0] ** 2 / (1.0 + lever))
        covariance = np.eye(residual.shape[1]) + spread @ np.swapaxes(self.columns, 1, 2)
        solved = np.linalg.solve(covariance, residual[..., None])[..., 0]
        return np.asarray(level + np.einsum("ck,ck->c", residual, solved))


class _Following(Columns):
    """Columns of candidates at K measurements that follow on the record, along its path."""

    def __init__(self, setup: Setup, table: Table) -> None:
        old = setup.data.measurements.table
        count, new = len(setup.data), len(next(iter(table.values())))
        session = {SESSION: np.full(new, "")} if SESSION in old else {}  # none of those before
        table = {**session, **table}
        whole = {name: np.concatenate([old[name], table[name]]) for name in old}
        data = place_at_rows(setup.data, whole)
        super().__init__(data, columns_at(setup, data).predict)
        self._rows = _rows_of_outputs(count + np.arange(new), count + new, len(data.outputs))

    def of(self, candidate: Candidate, shape: Mapping[str, float]) -> Array:
        """Columns (K, m) at the measurements that follow."""
        return super().of(candidate, shape)[self._rows]


class Points(ABC):
    """Further measurements: columns of effects, and (N, p) of the free parameters, there."""

    base: Array
    columns: Columns

    def predicted(self, fit: Fit) -> Predictions:
        """The prediction of a fit for them, in noise units."""
        return self.white(predictions(self.columns, self.base, fit))

    @abstractmethod
    def white(self, prediction: Predictions) -> Predictions:
        """A prediction in noise units; noise is correlated along the order of measuring."""


class Ahead(Points):
    """Measurements that follow on the record at the points of `table`, with the columns (N, p) of
    the free parameters there, and the record's noise.
    """

    def __init__(self, setup: Setup, noises: Sequence[Noise], table: Table, base: Array) -> None:
        self.table, self.base = table, base
        self.columns = _Following(setup, table)
        self._space = Space(tuple(replace(noise, sigma=np.full(len(self), noise.level), good=None) for noise in noises))

    def __len__(self) -> int:
        return len(next(iter(self.table.values())))

    def white(self, prediction: Predictions) -> Predictions:
        return Predictions(self._space.whiten(prediction.values), self._space.whiten(prediction.columns))


@dataclass(frozen=True)
class Field(Points):
    """Candidates of `per_candidate` measurements, their rows adjacent in `data`, with the columns
    (N, p) of the free parameters there, and the noise of the record.
    """

    setup: Setup
    axes: tuple[Axis, ...]
    data: GapData
    per_candidate: int
    base: Array
    columns: Columns
    noises: Sequence[Noise]

    def white(self, prediction: Predictions) -> Predictions:
        """A prediction in noise units; the measurements within a candidate are successive."""
        together = np.column_stack([prediction.values, prediction.columns])
        parts = np.split(together, len(self.noises))
        shape = (-1, self.per_candidate, together.shape[1])
        blocks = [
            _whiten_blocks((part / noise.level).reshape(shape), noise.rho if self.per_candidate > 1 else 0.0)
            for part, noise in zip(parts, self.noises, strict=True)
        ]
        whole = np.stack(blocks, axis=1).reshape(-1, together.shape[1])
        return Predictions(whole[:, 0], whole[:, 1:])

    @property
    def values_per_candidate(self) -> int:
        """The number of measured values per candidate, over all outputs."""
        return self.per_candidate * len(self.noises)

    def table(self, chosen: Chosen) -> tuple[Table, Array]:
        """The points in the order of measuring, and the free parameters' columns (N, p) there."""
        rows = (chosen[:, None] * self.per_candidate + np.arange(self.per_candidate)).ravel()
        table = {name: values[rows] for name, values in self.data.measurements.table.items()}
        known = self.setup.data.measurements.table
        if PATH.name in known:
            table[PATH.name] = np.full(len(rows), float(np.max(known[PATH.name])) + 1.0)
        ordered = {name: table[name] for name in known if name in table}
        return ordered, self.base[_rows_of_outputs(rows, len(self.data), len(self.noises))]


def _rows_of_outputs(rows: NDArray[np.int64], count: int, outputs: int) -> NDArray[np.int64]:
    """Some of `count` rows in each of the outputs, one below the other."""
    return np.concatenate([rows + k * count for k in range(outputs)])


def _whiten_blocks(blocks: Array, rho: float) -> Array:
    """Blocks (C, k, p) with autocorrelated noise, whitened so that it is independent."""
    if rho == 0.0:
        return blocks
    white = blocks.copy()
    white[:, 1:] = (blocks[:, 1:] - rho * blocks[:, :-1]) / np.sqrt(1.0 - rho**2)
    return white


def field_of(setup: Setup, noises: Sequence[Noise], wanted: NextPlan) -> Field:
    """The field of all candidates in the ranges. Raises InputError where the model reaches none."""
    path, seed = depends_on_path(setup.data), setup.plan.seed
    count, per_candidate = divide_into_cycles(wanted.readings) if path else (wanted.readings, 1)
    axes = axes_of(setup.data, wanted.ranges, count * per_candidate)
    table = cycles(setup.data, axes, per_candidate, seed) if path else candidates(setup.data, axes, seed)
    good = rows_in_range(setup.plan.model, table).reshape(-1, per_candidate).all(axis=1)
    if not good.any():
        raise refuse(RANGE, NO_POINT)
    sure = good if path else good & ~near_load_reversal(axes, table)
    good = sure if sure.any() else good
    table = {name: values[np.repeat(good, per_candidate)] for name, values in table.items()}
    more = (PATH,) if path and PATH.name not in setup.data.measurements.table else ()
    data = place_at_rows(setup.data, table, more)
    return Field(setup, axes, data, per_candidate, base_at(setup, data), columns_at(setup, data), noises)


def order_of_measuring(field: Field, chosen: Chosen) -> Ahead:
    """The chosen candidates in the order of measuring: by time, else at random."""
    setup, time = field.setup, _time(field.setup.data)
    if time is None:
        order = np.random.default_rng([setup.plan.seed, 10]).permutation(len(chosen))
    else:
        at = np.asarray(field.data.measurements.table[time])[chosen * field.per_candidate]
        order = np.argsort(at, kind="stable")
    table, base = field.table(chosen[order])
    return Ahead(setup, field.noises, timed(setup, field.axes, table), base)


def timed(setup: Setup, axes: Sequence[Axis], table: Table) -> Table:
    """The points with feasible times: in succession, a usual step apart."""
    name = _time(setup.data)
    if name is None:
        return table
    span = next(axis.span for axis in axes if axis.column.name == name)
    count = len(table[name])
    step = min(usual_step(setup.data.values(name), 1.0), (span.high - span.low) / max(count - 1, 1))
    places = step * np.arange(count)
    times = np.maximum.accumulate(np.asarray(table[name], dtype=float) - places) + places
    late = span.high - places[::-1]
    return {**table, name: np.round(np.minimum(times, late), 9)}


def continue_record(setup: Setup, noises: Sequence[Noise], count: int) -> Ahead:
    """`count` measurements like those of the record, continued in time; of a path its beginning."""
    n, rng = len(setup.data), np.random.default_rng([setup.plan.seed, 11])
    if depends_on_path(setup.data) or count >= n:
        rows = np.resize(np.arange(n), count)
    else:
        rows = np.sort(rng.choice(n, count, replace=False))
    table: dict[str, NDArray[Any]] = {name: values[rows] for name, values in setup.data.measurements.table.items()}
    name = _time(setup.data)
    if name is not None:
        old = setup.data.values(name)
        table[name] = old.max() + usual_step(old, 1.0) * (1.0 + np.arange(count))
    return Ahead(setup, noises, table, setup.base[_rows_of_outputs(rows, n, len(setup.data.outputs))])


def _time(data: GapData) -> str | None:
    """The column of the order of measuring."""
    return next((c.name for c in data.target.columns if c.role is Role.TIME), None)


# Exact designs by exchange: the points that separate the worst pair best.
#
# Reference: Fedorov, Theory of Optimal Experiments, 1972; Atkinson & Fedorov, Biometrika 62, 1975.

PASSES = 3
BETTER = 1e-4
"""Relative gain for which a point is exchanged."""
MEAN = 0.02
"""Weight of the mean over the pairs; the worst pair has the rest."""


def exchange_design(contests: Sequence[Contest], count: int) -> Chosen:
    """Indices (count,) of the candidates whose least discrimination over the contests is largest; a
    candidate may be chosen more than once.

    Points are exchanged from two starts: the best ones added one by one, and in turn those that are
    best for each contest alone. For a rival that follows any few points, adding a single point
    shows no difference.
    """
    starts = [greedy_design(contests, count)]
    if len(contests) > 1:
        alternating = np.concatenate([np.sort(greedy_design([contest], count)) for contest in contests])
        starts.append(alternating[:: len(contests)][:count])
    designs = [_exchange_until_settled(contests, start) for start in starts]
    return max(designs, key=lambda design: _level(contests, design))


def greedy_design(contests: Sequence[Contest], count: int) -> Chosen:
    """The design without exchange: the best candidate given the chosen ones is added one by one."""
    chosen = np.zeros(0, dtype=np.int64)
    for _ in range(count):
        chosen = np.append(chosen, _best(contests, chosen)[0])
    return chosen


def _exchange_until_settled(contests: Sequence[Contest], chosen: Chosen) -> Chosen:
    """A design whose points are exchanged in turn until that gains nothing."""
    for _ in range(PASSES):
        before = _level(contests, chosen)
        for at in range(len(chosen)):
            chosen = _exchange_point(contests, chosen, at)
        if _level(contests, chosen) < (1.0 + BETTER) * before:
            break
    return chosen


def _exchange_point(contests: Sequence[Contest], chosen: Chosen, at: int) -> Chosen:
    """The design with one of its points exchanged, where that is better."""
    rest = np.delete(chosen, at)
    point, level = _best(contests, rest)
    return np.insert(rest, at, point) if level > (1.0 + BETTER) * _level(contests, chosen) else chosen


def _best(contests: Sequence[Contest], chosen: Chosen) -> tuple[int, float]:
    """The candidate that is best given the chosen ones, and the level of both together."""
    levels = np.array([contest.with_each(chosen) for contest in contests])
    merit = (1.0 - MEAN) * levels.min(axis=0) + MEAN * levels.mean(axis=0)
    best = int(np.argmax(merit >= merit.max() - TIE * abs(merit.max())))
    return best, float(merit[best])


def _level(contests: Sequence[Contest], chosen: Chosen) -> float:
    """The least of the levels of a design, and a little of their mean."""
    levels = [contest.level(chosen)[0] for contest in contests]
    return (1.0 - MEAN) * min(levels) + MEAN * float(np.mean(levels))
