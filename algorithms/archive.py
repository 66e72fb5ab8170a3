"""The archive of a search: the best designs that it evaluated, within bounded memory."""

from __future__ import annotations

import numpy as np

from ..arrays import Array, Integers
from .engine.ordering import in_order, lowest_ranks_in_order
from .states import SavedState, State

ROOM = 1000
"""Feasible designs that are kept at least: as many as a report recomputes at full accuracy."""
GROWTH = 4
"""Times its size to which an archive grows before it is pruned."""


class Archive:
    """The feasible designs of the lowest ranks, and the least violating design.

    Every feasible non-dominated design is kept, and dominated ones by rank, earlier ones first, up
    to `room`. It is pruned when it has grown to four times that, so that a batch costs little; the
    kept designs depend on the batches alone.
    """

    def __init__(self, variables: int, objectives: int, room: int = ROOM) -> None:
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
    rows = _distinct(x, f)
    if len(rows) <= room:
        return np.sort(rows)
    rank = lowest_ranks_in_order(f.take(rows, axis=0), room)
    reached = np.bincount(rank).cumsum()
    room = max(room, int(reached[0]))
    last = int(reached.searchsorted(room))
    within = np.sort(rows[rank == last])[: room - int(reached[last - 1]) if last else room]
    return np.sort(np.concatenate([rows[rank < last], within]))


def _distinct(x: Array, f: Array) -> Integers:
    """The first row of each design, in the order of the objectives.

    Equal designs have equal objectives.
    """
    rows = in_order(*f.T, *x[:, :2].T)
    later, value = rows[1:], f[:, 0].take(rows)
    same = value[1:] == value[:-1]
    ties = same.nonzero()[0]
    same[ties] = (x.take(later[ties], axis=0) == x.take(rows[ties], axis=0)).all(axis=1)
    return np.concatenate([rows[:1], later[~same]])
