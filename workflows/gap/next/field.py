"""The candidate points of a next measurement, as measurements of the record's kind."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....arrays import Array
from ....errors import refuse
from ....models.effects.measurements import SESSION
from ....models.measurable import Role
from ..data import GapData
from ..fit import Fit
from ..library import Candidate, Columns
from ..noise import Noise
from ..plan import NextPlan
from ..setup import Setup
from ..space import Space
from .contest import Chosen
from .cycles import PATH, along_path, cycles, in_cycles
from .points import NO_POINT, RANGE, Axis, Table, axes_of, candidates, inside, turning, usual_step
from .rows import Predictions, base_at, columns_at, placed, predictions


class _Following(Columns):
    """Columns of candidates at K measurements that follow on the record, along its path."""

    def __init__(self, setup: Setup, table: Table) -> None:
        old = setup.data.measurements.table
        count, new = len(setup.data), len(next(iter(table.values())))
        session = {SESSION: np.full(new, "")} if SESSION in old else {}  # none of those before
        table = {**session, **table}
        whole = {name: np.concatenate([old[name], table[name]]) for name in old}
        data = placed(setup.data, whole)
        super().__init__(data, columns_at(setup, data).predict)
        self._rows = _of_outputs(count + np.arange(new), count + new, len(data.outputs))

    def of(self, candidate: Candidate, shape: Mapping[str, float]) -> Array:
        """Columns (K, m) at the measurements that follow."""
        return super().of(candidate, shape)[self._rows]


class Ahead:
    """Measurements that follow on the record at the points of `table`, with the columns (N, p) of
    the free parameters there, and the record's noise.
    """

    def __init__(self, setup: Setup, noises: Sequence[Noise], table: Table, base: Array) -> None:
        self.table, self.base = table, base
        self.columns: Columns = _Following(setup, table)
        self._space = Space(tuple(replace(noise, sigma=np.full(len(self), noise.level), good=None) for noise in noises))

    def __len__(self) -> int:
        return len(next(iter(self.table.values())))

    def predicted(self, fit: Fit) -> Predictions:
        """The prediction of a fit for them, whitened along their path."""
        return self.white(predictions(self.columns, self.base, fit))

    def white(self, prediction: Predictions) -> Predictions:
        """In noise units."""
        return Predictions(self._space.whiten(prediction.values), self._space.whiten(prediction.columns))


@dataclass(frozen=True)
class Field:
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

    def predicted(self, fit: Fit) -> Predictions:
        """The prediction of a fit for all candidates, whitened, the rows of each adjacent."""
        return self.white(predictions(self.columns, self.base, fit))

    def white(self, prediction: Predictions) -> Predictions:
        """A prediction in noise units; the measurements within a candidate are successive."""
        together = np.column_stack([prediction.values, prediction.columns])
        parts = np.split(together, len(self.noises))
        shape = (-1, self.per_candidate, together.shape[1])
        blocks = [
            _chained((part / noise.level).reshape(shape), noise.rho if self.per_candidate > 1 else 0.0)
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
        return ordered, self.base[_of_outputs(rows, len(self.data), len(self.noises))]


def _of_outputs(rows: NDArray[np.int64], count: int, outputs: int) -> NDArray[np.int64]:
    """Some of `count` rows in each of the outputs, one below the other."""
    return np.concatenate([rows + k * count for k in range(outputs)])


def _chained(blocks: Array, rho: float) -> Array:
    """Blocks (C, k, p) with autocorrelated noise, whitened so that it is independent."""
    if rho == 0.0:
        return blocks
    white = blocks.copy()
    white[:, 1:] = (blocks[:, 1:] - rho * blocks[:, :-1]) / np.sqrt(1.0 - rho**2)
    return white


def field_of(setup: Setup, noises: Sequence[Noise], wanted: NextPlan) -> Field:
    """The field of all candidates in the ranges. Raises InputError where the model reaches none."""
    path, seed = along_path(setup.data), setup.plan.seed
    count, per_candidate = in_cycles(wanted.readings) if path else (wanted.readings, 1)
    axes = axes_of(setup.data, wanted.ranges, count * per_candidate)
    table = cycles(setup.data, axes, per_candidate, seed) if path else candidates(setup.data, axes, seed)
    good = inside(setup.plan.model, table).reshape(-1, per_candidate).all(axis=1)
    if not good.any():
        raise refuse(RANGE, NO_POINT)
    sure = good if path else good & ~turning(axes, table)
    good = sure if sure.any() else good
    table = {name: values[np.repeat(good, per_candidate)] for name, values in table.items()}
    more = (PATH,) if path and PATH.name not in setup.data.measurements.table else ()
    data = placed(setup.data, table, more)
    return Field(setup, axes, data, per_candidate, base_at(setup, data), columns_at(setup, data), noises)


def ahead(field: Field, chosen: Chosen) -> Ahead:
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


def like_now(setup: Setup, noises: Sequence[Noise], count: int) -> Ahead:
    """`count` measurements like those of the record, continued in time; of a path its beginning."""
    n, rng = len(setup.data), np.random.default_rng([setup.plan.seed, 11])
    if along_path(setup.data) or count >= n:
        rows = np.resize(np.arange(n), count)
    else:
        rows = np.sort(rng.choice(n, count, replace=False))
    table: dict[str, NDArray[Any]] = {name: values[rows] for name, values in setup.data.measurements.table.items()}
    name = _time(setup.data)
    if name is not None:
        old = setup.data.values(name)
        table[name] = old.max() + usual_step(old) * (1.0 + np.arange(count))
    return Ahead(setup, noises, table, setup.base[_of_outputs(rows, n, len(setup.data.outputs))])


def _time(data: GapData) -> str | None:
    """The column of the order of measuring."""
    return next((c.name for c in data.target.columns if c.role is Role.TIME), None)
