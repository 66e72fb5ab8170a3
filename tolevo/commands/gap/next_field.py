"""Candidate points of a next measurement: predictions there, contests of explanations, designs by exchange."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import refuse
from ...models.effects.measurements import SESSION, measurements_of
from ...models.measurable import Column, Role
from ...section import Array
from .data import GapData
from .fit import Fit, Fitter, Space
from .library import Candidate, Columns, Predict, predictor
from .linear import basis, project_out
from .next_points import (
    NO_POINT,
    PATH,
    RANGE,
    Axis,
    Table,
    axes_of,
    candidates,
    cycles,
    depends_on_path,
    divide_into_cycles,
    near_load_reversal,
    rows_in_range,
    usual_step,
)
from .noise import Noise
from .plan import NextPlan
from .setup import Setup, change_of, zeros_of

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
    step = min(usual_step(setup.data.values(name)), (span.high - span.low) / max(count - 1, 1))
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
        table[name] = old.max() + usual_step(old) * (1.0 + np.arange(count))
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
    best = int(np.argmax(merit))
    return best, float(merit[best])


def _level(contests: Sequence[Contest], chosen: Chosen) -> float:
    """The least of the levels of a design, and a little of their mean."""
    levels = [contest.level(chosen)[0] for contest in contests]
    return (1.0 - MEAN) * min(levels) + MEAN * float(np.mean(levels))
