"""Many ways under several requirements: branch and bound on a linear master problem.

A node allows some ways of every feature. Its relaxation mixes allocations: columns (feature, way,
t), whose weights add up to one per feature, under tangent cuts of the requirements (Dantzig & Wolfe
1960; Kelley 1960). The prices of the cuts give a Lagrangian bound, separable and valid whatever the
linear programme returns; they show which columns are missing, and the mean allocation shows which cuts.
Columns and cuts serve all nodes. Branching is on the feature whose ways are mixed most.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...arrays import Array, Flags
from ...problems.forms import Feature, Form
from ...problems.spread import largest_parts, spread_of
from .combination import Combination
from .prices import ROUNDING
from .programme import Programme

GAP = 1e-4
"""Relative gap at which the search ends."""
NODES, ROUNDS = 60, 60
"""Nodes that are entered at most, and rounds of columns and cuts in one."""
BROKEN = 1e-6
"""Fraction of a limit by which a mean allocation may break it."""
PENALTY = 1e3
"""Price of breaking a cut by its limit, in units of the range of costs."""


@dataclass(frozen=True, slots=True)
class Solution:
    """Least cost at one set of limits, with a proven bound: ways and t (features,)."""

    chosen: tuple[int, ...]
    t: Array
    cost: float
    bound: float


Allowed = tuple[tuple[int, ...], ...]


@dataclass(eq=False)
class Master:
    """The search at upper limits (r,), `floor` and `ceiling` the range of the cost."""

    form: Form
    limit: Array
    floor: float
    ceiling: float
    best: Solution | None = None
    proven: float = -np.inf
    _columns: list[tuple[int, int, float, float]] = field(default_factory=list)
    _column_keys: set[tuple[int, int, float]] = field(default_factory=set)
    _cuts: list[tuple[int, Array, float]] = field(default_factory=list)
    _solved: set[tuple[int, ...]] = field(default_factory=set)

    def __post_init__(self) -> None:
        self._most = largest_parts(self.form)
        self._mean = np.zeros(len(self.form.features))
        self._asked = np.flatnonzero(np.isfinite(self.limit))
        ways = [
            (at, index, way) for at, feature in enumerate(self.form.features) for index, way in enumerate(feature.ways)
        ]
        self._owner = np.array([at for at, _, _ in ways])
        self._way = np.array([index for _, index, _ in ways])
        self._ways = [way for _, _, way in ways]
        self._linear, self._spread, self._offset = (
            np.array([getattr(way, name) or (0.0,) * len(self.limit) for way in self._ways])
            for name in ("linear", "spread", "offset")
        )
        for at, index, way in ways:
            for t in (way.low, way.high):
                self._add_column(at, index, t)
        middle = np.stack(
            [self._spread[self._owner == at].mean(axis=0) for at in range(len(self.form.features))], axis=1
        )
        for fraction in (0.1, 0.5, 1.0):
            wide = np.array([max(w.high for w in f.ways) for f in self.form.features])
            self._add_cuts(middle * wide * fraction, np.full(len(self.limit), -np.inf))

    def run(self) -> Solution | None:
        """The cheapest known allocation, with a proven bound; None without any."""
        root: Allowed = tuple(tuple(range(len(f.ways))) for f in self.form.features)
        heap: list[tuple[float, int, Allowed]] = [(self.floor, 0, root)]
        entered, proven = 0, np.inf
        while heap:
            bound, _, allowed = heapq.heappop(heap)
            if self._closed(bound) or entered >= NODES:
                proven = min(proven, bound)
                break
            entered += 1
            bound, weight = self._node(allowed, bound)
            if weight is None:
                proven = min(proven, bound)
                continue
            self._round(weight, allowed, self._mean)
            mixed = np.array([1.0 - w.max() if len(ways) > 1 else 0.0 for w, ways in zip(weight, allowed, strict=True)])
            if mixed.max() < 1e-9:
                proven = min(proven, bound)
                continue
            at = int(np.argmax(mixed))
            first = _heaviest(weight[at], allowed[at])
            others = tuple(way for way in allowed[at] if way != first)
            for side, ways in enumerate(((first,), others)):
                child = (*allowed[:at], ways, *allowed[at + 1 :])
                heapq.heappush(heap, (bound, 2 * entered + side, child))
        self.proven = np.inf if self._impossible(proven) else float(proven)
        return None if self.best is None else replace(self.best, bound=min(self.best.cost, proven))

    def _impossible(self, bound: float) -> bool:
        """No allocation costs more than the ceiling: none keeps the limits."""
        return bound > self.ceiling + GAP * abs(self.ceiling)

    def _closed(self, bound: float) -> bool:
        if self._impossible(bound):
            return True
        return self.best is not None and bound >= self.best.cost - GAP * abs(self.best.cost)

    # ---------------------------------------------------------------- a node

    def _node(self, allowed: Allowed, bound: float) -> tuple[float, list[Array] | None]:
        """The bound of a node, and the weights of each feature's ways; None where it is closed."""
        open_ = np.array([way in allowed[at] for at, way in zip(self._owner, self._way, strict=True)])
        weight: list[Array] | None = None
        for _ in range(ROUNDS):
            used, x, prices = self._programme(open_)
            lagrangian, t = self._lagrangian(prices, open_)
            bound = max(bound, lagrangian)
            if self._closed(bound):
                return bound, None
            weight = [np.zeros(len(feature.ways)) for feature in self.form.features]
            mean = np.zeros((len(self.limit), len(self.form.features)))
            self._mean = np.zeros(len(self.form.features))
            total = self.form.base
            value = self.form.offset.copy()
            for fraction, column in zip(x, used, strict=True):
                at, way, size, cost = self._columns[column]
                row = self._index(at, way)
                weight[at][way] += fraction
                self._mean[at] += fraction * size
                mean[:, at] += fraction * self._spread[row] * size
                value += fraction * (self._offset[row] + self._linear[row] * size)
                total += fraction * cost
            fresh = sum(
                self._add_column(int(at), int(way), float(size))
                for at, way, size in zip(self._owner[open_], self._way[open_], t, strict=True)
            )
            cut = self._add_cuts(mean, self.limit - value)
            if (not fresh and not cut) or (not cut and total - bound <= 0.1 * GAP * abs(total)):
                break
        return bound, weight

    def _index(self, at: int, way: int) -> int:
        return int(np.searchsorted(self._owner, at)) + way

    def _programme(self, open_: Flags) -> tuple[list[int], Array, Array]:
        """Columns, their weights, and the prices (cuts,) of the linear programme of a node."""
        used = [i for i, (at, way, _, _) in enumerate(self._columns) if open_[self._index(at, way)]]
        rows = np.array([self._index(*self._columns[i][:2]) for i in used])
        owner, size, cost = (np.array([self._columns[i][entry] for i in used]) for entry in (0, 2, 3))
        which, slope, room = self._cut_arrays()
        parts = self._offset[rows].T[which] + size * (
            self._linear[rows].T[which] + slope[:, owner] * self._spread[rows].T[which]
        )
        scale = np.maximum(np.abs(room), 1e-12)
        price = PENALTY * max(self.ceiling - self.floor, 1e-12)
        whole = np.hstack([parts / scale[:, None], -np.eye(len(which))])
        convexity = scipy.sparse.csr_matrix(
            (np.ones(len(used)), (owner, np.arange(len(used)))), shape=(len(self.form.features), len(used) + len(which))
        )
        linprog: Any = scipy.optimize.linprog  # its stubs know arrays of one dimension only
        solution = linprog(
            np.concatenate([cost, np.full(len(which), price)]),
            A_ub=whole,
            b_ub=room / scale,
            A_eq=convexity,
            b_eq=np.ones(len(self.form.features)),
            method="highs",
        )
        if solution.x is None:
            return used, np.zeros(len(used)), np.zeros(len(which))
        prices = np.maximum(-np.asarray(solution.ineqlin.marginals), 0.0) / scale
        return used, np.asarray(solution.x[: len(used)]), prices

    def _cut_arrays(self) -> tuple[NDArray[np.intp], Array, Array]:
        """Requirements (c,), slopes (c, features) and remaining room (c,) of the cuts; none without
        limits.
        """
        which = np.array([row for row, _, _ in self._cuts], dtype=np.intp)
        slope = np.array([direction for _, direction, _ in self._cuts])
        least = np.array([intercept for _, _, intercept in self._cuts])
        room = (self.limit - self.form.offset)[which] - least
        return which, slope.reshape(len(which), len(self.form.features)), room

    def _lagrangian(self, prices: Array, open_: Flags) -> tuple[float, Array]:
        """The bound at prices of the cuts, and the t of every open way there."""
        which, slope, room = self._cut_arrays()
        linear = np.zeros(len(self._ways))
        offset = np.zeros(len(self._ways))
        for row in self._asked:
            row_cuts = which == row
            total = prices[row_cuts].sum()
            linear += total * self._linear[:, row]
            linear += (prices[row_cuts] @ slope[row_cuts])[self._owner] * self._spread[:, row]
            offset += total * self._offset[:, row]
        t, value = np.zeros(len(self._ways)), np.full(len(self._ways), np.inf)
        for at in np.flatnonzero(open_).tolist():
            count = float(self.form.features[self._owner[at]].count)
            way, p = self._ways[at], linear[at : at + 1]
            best = way.curve.best(p / count, np.zeros(1), way.low, way.high)
            t[at] = best[0]
            value[at] = count * way.curve.cost(best)[0] + p[0] * best[0] + offset[at]
        least = np.full(len(self.form.features), np.inf)
        np.minimum.at(least, self._owner, value)
        received = float(prices @ room)
        slack = ROUNDING * (np.abs(least).sum() + float(prices @ np.abs(room)))
        return float(self.form.base + least.sum() - received - slack), t[open_]

    # ---------------------------------------------------------------- columns, cuts, allocations

    def _add_column(self, at: int, way: int, t: float) -> bool:
        key = at, way, float(f"{t:.7g}")
        if key in self._column_keys:
            return False
        self._column_keys.add(key)
        feature = self.form.features[at]
        cost = feature.count * float(feature.ways[way].curve.cost(np.array([t]))[0])
        self._columns.append((at, way, t, cost))
        return True

    def _add_cuts(self, s: Array, room: Array) -> bool:
        """Tangents at s (r, features) of the requirements whose S exceeds its `room` (r,)."""
        spread = spread_of(self.form, s[None], self._most)
        added = False
        for row in self._asked.tolist():
            excess = spread.value[0, row] - room[row]
            broken = excess > BROKEN * abs(self.limit[row])
            if broken and np.isfinite(spread.intercept[0, row]):
                self._cuts.append((row, spread.direction[0, row], float(spread.intercept[0, row])))
                added = True
        return added

    def _round(self, weight: list[Array], allowed: Allowed, start: Array) -> None:
        """Solve the ways of most weight, and at first the tightest of those that have weight too."""
        heavy = tuple(map(_heaviest, weight, allowed))
        tight = tuple(map(_tightest, self.form.features, weight, allowed, heavy))
        for chosen in (heavy, tight) if self.best is None else (heavy,):
            self._leaf(chosen, start)

    def _leaf(self, chosen: tuple[int, ...], start: Array) -> None:
        if chosen in self._solved:
            return
        self._solved.add(chosen)
        combination = Combination(self.form, chosen)
        t = Programme(combination).kept_allocation(self.limit, start)
        if t is None:
            return
        for at, (way, tolerance) in enumerate(zip(chosen, t.tolist(), strict=True)):
            self._add_column(at, way, tolerance)
        self._add_cuts(combination.parts(t[None, :])[0], np.full(len(self.limit), -np.inf))
        cost = float(combination.cost(t[None, :])[0])
        if self.best is None or cost < self.best.cost:
            self.best = Solution(chosen, t, cost, -np.inf)


def _heaviest(weight: Array, ways: tuple[int, ...]) -> int:
    """The way of most weight among some; after a linear programme that failed all weights are 0."""
    return max(ways, key=weight.tolist().__getitem__)


def _tightest(feature: Feature, weight: Array, ways: tuple[int, ...], default: int) -> int:
    """The way with the least lower end of its range, of those that have weight."""
    mixed = (way for way in ways if weight[way] > 1e-6)
    return min(mixed, default=default, key=lambda way: feature.ways[way].low)
