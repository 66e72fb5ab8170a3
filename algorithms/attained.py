"""The hypervolume that a search has attained after each batch, computed for many at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..arrays import Array, Flags, Integers
from .engine.ordering import in_order
from .indicators import REFERENCE, hypervolume, nondominated
from .states import SavedState, State

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
            join = joined_by_two if self.front.shape[1] == 2 else joined_by_any
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


def joined_by_any(
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


def joined_by_two(
    front: Array, batches: Sequence[Array], ideal: Array, nadir: Array, value: float
) -> tuple[Array, list[float]]:
    """`joined_by_any` of two objectives, the front sorted by the first: one sort for all batches.

    A point is present from its batch on. It is in the front while no present point that precedes it
    in the order of the first objective has as little of the second.
    """
    points, since = _in_order(front, batches)
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
    values, begin = [], 0
    for end, new in zip(ends.tolist(), joins.tolist(), strict=True):
        if new:
            value = float(widths[begin:end] @ heights[begin:end])
        begin = end
        values.append(value)
    return values


def _in_order(front: Array, batches: Sequence[Array]) -> tuple[Array, Integers]:
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
    order = in_order(points[0], points[1], since)
    return points.take(order, axis=1), since.take(order)
