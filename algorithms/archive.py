"""What a search remembers: the best designs it saw, within bounded memory."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .indicators import nondominated

Array = NDArray[np.float64]
State = dict[str, NDArray[Any]]
ROOM = 1000
"""Feasible designs that are kept at least: as many as a report recomputes at full accuracy."""

ODD = np.uint64(0x9E3779B97F4A7C15)
"""Factor of a multiplicative hash (Knuth, TAOCP 3, section 6.4)."""


class Archive:
    """The feasible designs of the lowest ranks, the front, and the least violating design.

    Every feasible non-dominated design is kept, and dominated ones by rank, the earlier first, up
    to `room`. It is pruned when it has grown to twice the size, so that a batch costs little; what
    is kept depends on the batches alone.
    """

    def __init__(self, variables: int, objectives: int, room: int = ROOM) -> None:
        self.room = room
        self.limit = 2 * room
        self.x = np.empty((0, variables))
        self.f = np.empty((0, objectives))
        self.front = np.empty((0, objectives))
        self.miss = np.empty((0, variables))
        self.violation = np.inf
        self.changes = 0
        self._new: list[tuple[Array, Array]] = []
        self._count = 0

    def add(self, x: Array, f: Array, violation: Array) -> NDArray[np.bool_]:
        """Take in a batch: designs (n, variables), objectives, total violation (n,).

        Returns which are feasible.
        """
        feasible = violation <= 0.0
        self._note_miss(x, violation)
        if feasible.any():
            x, f = (x, f) if feasible.all() else (x[feasible], f[feasible])
            self._new.append((x, f))
            self._count += len(x)
            self._widen(f)
            if self._count > self.limit:
                self._prune()
        return feasible

    def arrays(self) -> tuple[Array, Array]:
        """Designs (n, variables) and objectives (n, objectives) of what is kept, oldest first."""
        self._collect()
        return self.x, self.f

    def _note_miss(self, x: Array, violation: Array) -> None:
        if self.violation > 0.0 and len(violation):
            least = int(np.argmin(violation))
            if violation[least] < self.violation:
                self.violation, self.miss = float(violation[least]), x[least : least + 1].copy()

    def _widen(self, f: Array) -> None:
        """Join objectives to the front; `changes` counts how often that changed it."""
        if self.front.shape[1] == 2:
            joined = joined_front(self.front, f)
            if joined is not self.front:
                self.front = joined
                self.changes += 1
            return
        merged = np.concatenate([self.front, f])
        kept = nondominated(merged)
        if kept[len(self.front) :].any():
            self.front = merged[kept]
            self.changes += 1

    def _collect(self) -> None:
        if self._new:
            self.x = np.concatenate([self.x, *(x for x, _ in self._new)])
            self.f = np.concatenate([self.f, *(f for _, f in self._new)])
            self._new.clear()

    def _prune(self) -> None:
        self._collect()
        rows = lowest_ranks(self.x, self.f, self.room)
        self.x, self.f = self.x[rows], self.f[rows]
        self._count = len(rows)
        self.limit = 2 * max(self.room, self._count)

    def state(self) -> State:
        """Everything as arrays."""
        x, f = self.arrays()
        numbers = np.array([self.violation, self.limit, self.changes])
        return {"x": x, "f": f, "front": self.front, "miss": self.miss, "numbers": numbers}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from a `state()`."""
        self.x, self.f = state["x"], state["f"]
        front, self.miss = state["front"], state["miss"]
        self.front = joined_front(front[:0], front) if front.shape[1] == 2 else front
        self.violation = float(state["numbers"][0])
        self.limit, self.changes = (int(number) for number in state["numbers"][1:])
        self._new.clear()
        self._count = len(self.x)


def joined_front(front: Array, f: Array) -> Array:
    """A front of two objectives, sorted by the first, joined by points (n, 2); itself if by none.

    Only points that no point of the front dominates or equals take part, which are few.
    """
    if len(front):
        at = np.searchsorted(front[:, 0], f[:, 0], side="right") - 1
        f = f[(at < 0) | (f[:, 1] < front[at, 1])]
        if not len(f):
            return front
    merged = np.concatenate([front, f])
    merged = merged[np.lexsort((merged[:, 1], merged[:, 0]))]
    least = np.minimum.accumulate(merged[:, 1])
    kept = np.ones(len(merged), dtype=bool)
    kept[1:] = merged[1:, 1] < least[:-1]
    return np.asarray(merged[kept])


def lowest_ranks(x: Array, f: Array, room: int) -> NDArray[np.int64]:
    """Rows of the different designs of the lowest ranks, at least the non-dominated ones.

    In the order of the rows; where a rank does not fit into `room`, its first ones.
    """
    rows = _distinct(x, f)
    if len(rows) <= room:
        return rows
    values = f[rows]
    if values.shape[1] == 1:
        rank = values[:, 0]
    else:
        import moocore

        rank = moocore.pareto_rank(values)
    best = int(np.count_nonzero(rank == rank.min()))
    return np.sort(rows[np.argsort(rank, kind="stable")[: max(room, best)]])


def _distinct(x: Array, f: Array) -> NDArray[np.int64]:
    """The first row of each design, in order: equal designs have equal objectives."""
    if not len(x):
        return np.empty(0, dtype=np.int64)
    order = np.lexsort((*x.T[:2], *f.T))  # stable, so that the first of equal rows comes first
    near, before = order[1:], order[:-1]
    same = np.all(f[near] == f[before], axis=1)
    same[same] = np.all(x[near[same]] == x[before[same]], axis=1)
    return np.sort(np.concatenate([order[:1], near[~same]]))
