"""What a search has found: the archive, and what it had attained as it went."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..section import Array, Flags, Integers

State = dict[str, NDArray[Any]]
SavedState = Mapping[str, NDArray[Any]]


def part(state: SavedState, prefix: str) -> State:
    """The entries of a state whose names have a prefix, named without it."""
    return {key.removeprefix(prefix): value for key, value in state.items() if key.startswith(prefix)}


def merge_states(**parts: State) -> State:
    """The entries of several states in one: the `key` of the state `name` is named "name.key"."""
    return {f"{name}.{key}": value for name, state in parts.items() for key, value in state.items()}


# Rows in an order of several keys, and the lowest non-domination ranks of ordered rows.


PASSES = 16
"""Ranks that are computed one after the other; where more are needed, all are computed at once."""


def lexicographic_order(*keys: NDArray[Any]) -> Integers:
    """Rows (n,) ordered by the first key (n,), where it is equal by the next ones, then by row.

    The order is that of `np.lexsort` of the reversed keys, several times as fast where values of the
    first key seldom repeat.
    """
    order = keys[0].argsort()
    value = keys[0].take(order)
    same = value[1:] == value[:-1]
    if np.count_nonzero(same):
        tied = np.zeros(len(order), dtype=bool)
        tied[1:] = same
        tied[:-1] |= same
        at = tied.nonzero()[0]
        rows = order.take(at)
        order[at] = rows.take(np.lexsort((rows, *(key.take(rows) for key in reversed(keys)))))
    return order


def ranks(f: Array) -> Integers:
    """Non-domination rank (n,) of objectives (n, m), the best is 0; equal points rank equally."""
    if f.shape[1] == 1:
        return np.unique(f[:, 0], return_inverse=True)[1].astype(np.int64)
    import moocore

    return np.asarray(moocore.pareto_rank(f), dtype=np.int64)


def lowest_ranks_in_order(f: Array, enough: int) -> Integers:
    """`ranks` (n,) of points (n, m) that are `lexicographic_order` of their objectives, the lowest of them.

    Ranks after the one with which `enough` points are reached are not distinguished. With two
    objectives each rank takes one pass over the remaining points.
    """
    if f.shape[1] != 2:
        return ranks(f)
    first, second = f.T
    assigned, rest = np.zeros(len(f), dtype=np.int64), np.arange(len(f))
    for rank in range(1, PASSES + 1):
        rest = rest[~_nondominated_of_two(first.take(rest), second.take(rest))]
        assigned[rest] = rank
        if len(rest) <= max(0, len(f) - enough):
            return assigned
    assigned[rest] += ranks(f.take(rest, axis=0))
    return assigned


def _nondominated_of_two(first: Array, second: Array) -> Flags:
    """Which of the points in order, of two objectives (n,) each, are not dominated.

    The second objective is less than that of all points before, or the point equals the last point
    for which that is true.
    """
    least = np.minimum.accumulate(second)
    lower = np.ones(len(first), dtype=bool)
    np.less(second[1:], least[:-1], out=lower[1:])
    last = np.maximum.accumulate(np.where(lower, first, -np.inf))
    lowest: Flags = (second == least) & (first == last)
    return lowest


# The archive of a search: the best designs that it evaluated, within bounded memory.


MIN_KEPT_DESIGNS = 1000
"""Feasible designs that are kept at least: as many as a report recomputes at full accuracy."""
GROWTH = 4
"""Times its size to which an archive grows before it is pruned."""


class Archive:
    """The feasible designs of the lowest ranks, and the least violating design.

    Every feasible non-dominated design is kept, and dominated ones by rank, earlier ones first, up
    to `room`. It is pruned when it has grown to four times that, so that a batch costs little; the
    kept designs depend on the batches alone.
    """

    def __init__(self, variables: int, objectives: int, room: int = MIN_KEPT_DESIGNS) -> None:
        self.room = room
        self.limit = GROWTH * room
        self.x = np.empty((0, variables))
        self.f = np.empty((0, objectives))
        self.miss = np.empty((0, variables))
        self.violation = np.inf
        self._new: list[tuple[Array, Array]] = []
        self._count = 0

    def add(self, x: Array, f: Array, violation: Array) -> Array:
        """Take in a batch: designs (n, variables), objectives, total violation (n,).

        Returns the objectives of the feasible ones.
        """
        feasible = violation <= 0.0
        self._note_miss(x, violation)
        if np.count_nonzero(feasible) < len(feasible):
            x, f = x[feasible], f[feasible]
        if len(x):
            self._new.append((x, f))
            self._count += len(x)
            if self._count > self.limit:
                self._prune()
        return f

    def arrays(self) -> tuple[Array, Array]:
        """Designs (n, variables) and objectives (n, objectives) in the archive, oldest first."""
        self._collect()
        return self.x, self.f

    @property
    def has_values(self) -> bool:
        """Whether any evaluation so far did not fail."""
        return bool(self._count or len(self.miss))

    def _note_miss(self, x: Array, violation: Array) -> None:
        if self.violation > 0.0 and len(violation):
            least = int(np.argmin(violation))
            if violation[least] < self.violation:
                self.violation, self.miss = float(violation[least]), x[least : least + 1].copy()

    def _collect(self) -> None:
        if self._new:
            self.x = np.concatenate([self.x, *(x for x, _ in self._new)])
            self.f = np.concatenate([self.f, *(f for _, f in self._new)])
            self._new.clear()

    def _prune(self) -> None:
        self._collect()
        rows = lowest_ranks(self.x, self.f, self.room)
        self.x, self.f = self.x.take(rows, axis=0), self.f.take(rows, axis=0)
        self._count = len(rows)
        self.limit = GROWTH * max(self.room, self._count)

    def state(self) -> State:
        """Everything as arrays."""
        x, f = self.arrays()
        return {"x": x, "f": f, "miss": self.miss, "numbers": np.array([self.violation, self.limit])}

    def restore(self, state: SavedState) -> None:
        """Continue from a `state()`."""
        self.x, self.f, self.miss = state["x"], state["f"], state["miss"]
        self.violation, self.limit = float(state["numbers"][0]), int(state["numbers"][1])
        self._new.clear()
        self._count = len(self.x)


def lowest_ranks(x: Array, f: Array, room: int) -> Integers:
    """Rows of the different designs of the lowest ranks, at least the non-dominated ones.

    They are in the order of the rows; of a rank that does not fit into `room`, the first rows count.
    """
    rows = _first_of_each_design(x, f)
    if len(rows) <= room:
        return np.sort(rows)
    rank = lowest_ranks_in_order(f.take(rows, axis=0), room)
    reached = np.bincount(rank).cumsum()
    room = max(room, int(reached[0]))
    last = int(reached.searchsorted(room))
    within = np.sort(rows[rank == last])[: room - int(reached[last - 1]) if last else room]
    return np.sort(np.concatenate([rows[rank < last], within]))


def _first_of_each_design(x: Array, f: Array) -> Integers:
    """The first row of each design, in the order of the objectives.

    Equal designs have equal objectives.
    """
    rows = lexicographic_order(*f.T, *x[:, :2].T)
    later, value = rows[1:], f[:, 0].take(rows)
    same = value[1:] == value[:-1]
    ties = same.nonzero()[0]
    same[ties] = (x.take(later[ties], axis=0) == x.take(rows[ties], axis=0)).all(axis=1)
    return np.concatenate([rows[:1], later[~same]])


# Dominance and hypervolume: of two objectives by sorting, of more by moocore.


REFERENCE = 1.1
"""Reference point of the normalised hypervolume, in every objective."""


DIGITS = 30
"""Binary digits of values that are compared: the last ones are rounding, which differs between processors."""


def without_rounding(values: Array) -> Array:
    """Values (n, any number) of which only the first `DIGITS` digits remain."""
    mantissa, exponent = np.frexp(values)
    return np.asarray(np.ldexp(np.rint(np.ldexp(mantissa, DIGITS)), exponent - DIGITS))


def nondominated(values: Array) -> Flags:
    """Which rows of (n, objectives) no other row dominates; the first of those that are equal but for a rounding."""
    values = without_rounding(values)
    if values.shape[1] == 1:
        best = np.zeros(len(values), dtype=bool)
        if len(values):
            best[int(np.argmin(values[:, 0]))] = True
        return best
    if values.shape[1] == 2:
        order = np.lexsort((values[:, 1], values[:, 0]))  # stable: the first of equal rows leads
        second = values[order, 1]
        before = np.minimum.accumulate(np.concatenate([[np.inf], second[:-1]]))
        kept = np.zeros(len(values), dtype=bool)
        kept[order] = second < before
        return kept
    import moocore

    mask = moocore.is_nondominated(values, keep_weakly=False)
    return np.asarray(mask, dtype=bool)


def hypervolume(values: Array, ideal: Array, nadir: Array) -> float:
    """Hypervolume of (F - ideal)/(nadir - ideal) with reference point 1.1."""
    scaled = (values - ideal) / (nadir - ideal)
    inside = scaled[np.all(scaled < REFERENCE, axis=1)]
    if not len(inside):
        return 0.0
    if scaled.shape[1] == 1:
        return float(REFERENCE - inside.min())
    if scaled.shape[1] == 2:
        front = inside[nondominated(inside)]
        return area(*front[np.argsort(front[:, 0])].T)
    import moocore

    return float(moocore.hypervolume(inside, ref=np.full(scaled.shape[1], REFERENCE)))


def area(first: Array, second: Array) -> float:
    """Hypervolume of a front of two objectives (n,) each, normalised, sorted by the first, all of
    it below the reference point.
    """
    if not len(first):
        return 0.0
    widths = np.empty(len(first))
    np.subtract(first[1:], first[:-1], out=widths[:-1])
    widths[-1] = REFERENCE - first[-1]
    return float(np.sum(widths * (REFERENCE - second)))  # no dot product: kernels of BLAS sum by alignment


# The hypervolume that a search has attained after each batch, computed for many at once.


TOGETHER = 16
"""Batches that wait at most for a common computation."""


class Attained:
    """Front of all feasible objectives (n, objectives), and its hypervolume after each batch.

    A sort per batch would cost as much as a step of an array engine, so that batches wait until a
    value is needed. The values do not depend on when that is. `box` returns ideal and nadir; it is
    called after the first feasible design.
    """

    def __init__(self, objectives: int, box: Callable[[], tuple[Array, Array]]) -> None:
        self.front = np.empty((0, objectives))
        self._box = box
        self._values: list[float] = []
        self._open: list[Array] = []

    def add(self, f: Array) -> None:
        """Take in the feasible objectives (n, objectives) of a batch."""
        self._open.append(f)
        if len(self._open) >= TOGETHER:
            self._settle()

    def values(self) -> list[float]:
        """The hypervolume after each batch so far; 0 before the first feasible design."""
        self._settle()
        return self._values

    def _settle(self) -> None:
        if not self._open:
            return
        last = self._values[-1] if self._values else 0.0
        if len(self.front) or any(map(len, self._open)):
            join = update_front_of_two if self.front.shape[1] == 2 else update_front_by_batches
            front, values = join(self.front, self._open, *self._box(), last)
        else:
            front, values = self.front, [last] * len(self._open)
        self.front, self._open = front, []
        self._values += values

    def state(self) -> State:
        """Front and values."""
        return {"values": np.array(self.values()), "front": self.front}

    def restore(self, state: SavedState) -> None:
        """Continue from a `state()`."""
        self.front = np.array(state["front"])
        self._values, self._open = state["values"].tolist(), []


def update_front_by_batches(
    front: Array, batches: Sequence[Array], ideal: Array, nadir: Array, value: float
) -> tuple[Array, list[float]]:
    """A front that batches (n, objectives) have joined, and its hypervolume after each of them.

    `value` is the hypervolume before.
    """
    values = []
    for batch in batches:
        merged = np.concatenate([front, batch])
        kept = nondominated(merged)
        if kept[len(front) :].any():
            front = merged[kept]
            value = hypervolume(front, ideal, nadir)
        values.append(value)
    return front, values


def update_front_of_two(
    front: Array, batches: Sequence[Array], ideal: Array, nadir: Array, value: float
) -> tuple[Array, list[float]]:
    """`update_front_by_batches` of two objectives, the front sorted by the first: one sort for all batches.

    A point is present from its batch on. It is in the front while no present point that precedes it
    in the order of the first objective has as little of the second.
    """
    points, since = _order_with_batches(front, batches)
    batch = np.arange(len(batches))[:, None]
    present = np.where(since <= batch, points[1], np.inf)
    kept = present < np.inf
    kept[:, 1:] &= present[:, 1:] < np.fmin.accumulate(present, axis=1)[:, :-1]
    joins = (kept & (since == batch)).any(axis=1)
    scaled = (points - ideal[:, None]) / (nadir - ideal)[:, None]
    counted = kept & (scaled < REFERENCE).all(axis=0)
    return points.compress(kept[-1], axis=1).T, _areas(scaled, counted, joins, value)


def _areas(scaled: Array, counted: Flags, joins: Flags, value: float) -> list[float]:
    """`area` of the points (2, n) that are `counted` (batches, n) after each batch (batches,).

    Where no point joins it is that of the batch before, at first `value`.
    """
    ends = counted.sum(axis=1).cumsum()
    column = np.arange(scaled.shape[1])[None, :].repeat(len(counted), axis=0)
    first, second = scaled.take(column[counted], axis=1)
    widths, heights = np.empty_like(first), REFERENCE - second
    np.subtract(first[1:], first[:-1], out=widths[:-1])
    last = ends[np.diff(ends, prepend=0) > 0] - 1
    widths[last] = REFERENCE - first[last]
    areas = widths * heights
    values, begin = [], 0
    for end, new in zip(ends.tolist(), joins.tolist(), strict=True):
        if new:
            value = float(np.sum(areas[begin:end]))
        begin = end
        values.append(value)
    return values


def _order_with_batches(front: Array, batches: Sequence[Array]) -> tuple[Array, Integers]:
    """Points (2, n) by the first objective, the second, and the batch (n,) they come with.

    Points of the front have -1 as batch; points that it dominates or equals are omitted.
    """
    points = np.concatenate([front, *batches]).T.copy()
    since = np.arange(-1, len(batches)).repeat([len(front), *map(len, batches)])
    if len(front):
        new = points[:, len(front) :]
        order = new[0].argsort()  # sorted values are looked up several times as fast
        at = np.empty_like(order)
        at[order] = front[:, 0].searchsorted(new[0].take(order), side="right") - 1
        better = (at < 0) | (new[1] < front[:, 1].take(at))
        kept = np.concatenate([np.arange(len(front)), better.nonzero()[0] + len(front)])
        points, since = points.take(kept, axis=1), since.take(kept)
    order = lexicographic_order(points[0], points[1], since)
    return points.take(order, axis=1), since.take(order)


# The course of a search: its value by generation, and the evaluations at which it reached a level.
#
# A hypervolume in every generation would cost as much as an array engine itself. Values are collected;
# hypervolumes are computed at few generations and, where a level was passed between two of them, by
# bisection, because the hypervolume of all evaluated designs never falls.


CURVE = ("generation", "evaluations", "cpu_s", "value", "feasible_fraction")
"""Columns of a curve."""
PER_OCTAVE = {1: 64}
"""Generations of a curve between g and 2 g by the number of objectives, where a value is cheap."""
DEFAULT_PER_OCTAVE = 4
BLOCK = 20_000
"""Feasible values after which their front replaces them, so that memory is bounded."""


class Batch(NamedTuple):
    """A generation: evaluations and CPU time up to its end, its feasible fraction, and its feasible
    designs, by the numbers of their evaluations (n,) and their objectives (n, objectives).
    """

    generation: int
    evaluations: int
    cpu_s: float
    feasible_fraction: float
    numbers: Integers
    values: Array


@dataclass(frozen=True, slots=True)
class Box:
    """Ideal and nadir (objectives,) of the normalised hypervolume."""

    ideal: tuple[float, ...]
    nadir: tuple[float, ...]

    def hypervolume(self, values: Array) -> float:
        """Normalised hypervolume of objectives (n, objectives)."""
        return hypervolume(values, np.array(self.ideal), np.array(self.nadir))


def is_charted_generation(generation: int, per_octave: int) -> bool:
    """Whether a generation (from 1) belongs to a curve, at any end of the curve."""
    step = 1 << max(0, generation.bit_length() - per_octave.bit_length())
    return generation % step == 0


class Course:
    """The course of one search, by its batches.

    The value of a curve is, with one objective, the least feasible value so far (NaN before the
    first), else the hypervolume of all feasible values. `level` is the value that the search is to
    reach: from above with one objective, from below for a hypervolume; NaN where there is none.
    """

    def __init__(self, box: Box, level: float) -> None:
        self.box = box
        self.level = level
        self.objectives = len(box.ideal)
        self.front = np.empty((0, self.objectives))
        self.reached_at: tuple[float, float] = (np.nan, np.nan)
        self.batches = 0
        self.evaluations = 0
        self.feasible = 0
        self._rows: list[tuple[float, ...]] = []
        self._open: list[Batch] = []
        self._waiting = 0
        self._per_octave = PER_OCTAVE.get(self.objectives, DEFAULT_PER_OCTAVE)

    def add(self, f: Array, feasible: Flags, cpu_s: float) -> None:
        """Take in a batch: objectives (n, objectives), feasible (n,), CPU time used so far [s]."""
        self.batches += 1
        rows = np.flatnonzero(feasible)
        fraction = len(rows) / len(f) if len(f) else 0.0
        numbers = (self.evaluations + rows + 1).astype(np.int64)
        self.evaluations += len(f)
        self.feasible += len(rows)
        feasible_values = f if len(rows) == len(f) else f[rows]
        self._open.append(Batch(self.batches, self.evaluations, cpu_s, fraction, numbers, feasible_values))
        self._waiting += len(rows)
        if self._waiting > BLOCK:
            self._settle()

    def curve(self) -> Array:
        """Rows (k, columns of `CURVE`); the last batch is always one of them."""
        self._settle(last=True)
        return np.array(self._rows, dtype=float).reshape(-1, len(CURVE))

    @property
    def value(self) -> float:
        """The value at the end; NaN where one objective has no feasible design."""
        return self._value(self.front)

    def _settle(self, last: bool = False) -> None:
        """Chart the open batches and replace their values by the front."""
        group: list[Batch] = []
        for batch in self._open:
            group.append(batch)
            end = last and batch is self._open[-1]
            if end or is_charted_generation(batch.generation, self._per_octave):
                self._chart(group)
                group = []
        self._open = group
        self._waiting = sum(len(batch.values) for batch in group)

    def _chart(self, group: list[Batch]) -> None:
        """Add the last batch of a group to the curve, after those before it."""
        before, news = self.front, np.concatenate([batch.values for batch in group])
        if len(news):
            merged = np.concatenate([before, news])
            self.front = merged[nondominated(merged)]
        value = self._value(self.front)
        if np.isnan(self.reached_at[0]) and self._reached(value):
            self.reached_at = self._passed(before, news, group)
        last = group[-1]
        self._rows.append((last.generation, last.evaluations, last.cpu_s, value, last.feasible_fraction))

    def _passed(self, before: Array, news: Array, group: list[Batch]) -> tuple[float, float]:
        """Evaluations, and CPU time at the end of their batch, at which the level was passed."""
        low, high = 0, len(news)
        while high - low > 1:
            middle = (low + high) // 2
            reached = self._reached(self._value(np.concatenate([before, news[:middle]])))
            low, high = (low, middle) if reached else (middle, high)
        evaluations = int(np.concatenate([batch.numbers for batch in group])[high - 1])
        return evaluations, next(batch.cpu_s for batch in group if batch.evaluations >= evaluations)

    def _reached(self, value: float) -> bool:
        return bool(value <= self.level if self.objectives == 1 else value >= self.level)

    def _value(self, values: Array) -> float:
        if self.objectives > 1:
            return self.box.hypervolume(values)
        return float(values.min()) if len(values) else np.nan
