"""Alternative ways of making a feature: branch and bound over them, for many limits at once.

Every node fixes the ways of the first features. Its bound is Lagrangian at a few prices around those
of the best known allocation: it is separable, so that every open feature has its best way. A node is
pruned at all limits where its bound shows that it cannot be cheaper; where no feature is open the
allocation is solved. At most `LEAVES` allocations are solved; nodes that are not entered count with
their bounds, so that the returned bound is always proven.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise

import numpy as np

from ...arrays import Array, Flags, Integers
from ...journal import recalled
from ...problems.forms import Feature, Form
from ...problems.spread import Spread, largest_parts
from .ascent import Ascent
from .combination import Combination
from .combination import Optimum as Optimum
from .doubt import least_under_doubt
from .master import Master
from .path import Path
from .points import least_of_points, only_points
from .prices import ROUNDING, less_rounding, rows_of, spread_at, tabulated
from .programme import Programme
from .separable import Leaf, Squares, least_leaf, separable, separable_but_for_doubt

Watch = Callable[[Optimum, float], None]
"""Called with optima as they are solved, and the fraction of all that is solved."""


def unwatched(optimum: Optimum, share: float) -> None:
    """Do nothing with what is solved."""


GRID = np.unique(np.concatenate([np.geomspace(0.02, 50.0, 15), np.geomspace(0.7, 1.4, 13)]))
"""Prices at which nodes are bounded, in units of the best known allocation's own."""
PASSES = 8
"""Times the prices are improved at most before the search."""
ROUNDS = 4
"""Times all multipliers are improved at most, each after a better allocation."""
LEAVES = 4096
"""Allocations that are solved at most."""
MANY = 1000
"""Combinations of ways from which on prices of squares exclude most of them at once."""
MIXED = 5
"""Features with several ways from which on quantiles are searched by a linear master problem."""
CLOSE = 1e-10
"""A node whose bound is this close to the best cost cannot improve it noticeably."""


def least_cost(form: Form, limits: Array, watch: Watch = unwatched) -> Optimum:
    """The cheapest allocation that keeps each set of upper limits (n, r) of a form.

    Cost and bound are inf where no allocation can keep them, the cost alone where none is known.
    `watch` is called with what is solved, and its fraction of the whole.
    """
    limits = np.asarray(limits, dtype=float)
    if form.quantiles and sum(len(feature.ways) > 1 for feature in form.features) >= MIXED:
        return _each(form, limits, watch, lambda limit, _: _by_master(form, limit))
    if only_points(form):
        return _together(form, limits, watch, lambda: least_of_points(form, limits))
    if separable_but_for_doubt(form) and not _pointed(form):
        return _together(form, limits, watch, lambda: least_under_doubt(form, limits, cost_range(form)[0]))
    several = len(form.outputs) > 1
    if (several or form.combinations > MANY) and _priced(form):
        return _by_squares(form, limits, watch)
    if form.combinations == 1 or form.separable or len(limits) < 2:
        return _together(form, limits, watch, lambda: _least_cost(form, limits, None))
    # multipliers of several requirements are improved for each alone
    return _each(form, limits, watch, lambda limit, previous: _least_cost(form, limit, previous))


def _together(form: Form, limits: Array, watch: Watch, solve: Callable[[], Optimum]) -> Optimum:
    """What `solve` returns for all limits, unless it was solved before."""
    optimum = _recalled(form, limits, solve)
    watch(optimum, 1.0)
    return optimum


def _each(form: Form, limits: Array, watch: Watch, solve: Callable[[Array, Optimum | None], Optimum]) -> Optimum:
    """What `solve` returns for one set of limits (1, r) after the other, next to the one before."""
    optima: list[Optimum] = []
    for done, limit in enumerate(limits, 1):
        solved = partial(solve, limit[None, :], optima[-1] if optima else None)
        optima.append(_recalled(form, limit, solved))
        watch(optima[-1], done / len(limits))
    return _joined([Optimum.unknown(form, limits[:0]), *optima])


def _joined(optima: list[Optimum]) -> Optimum:
    """The optima below each other."""
    names = Optimum.__dataclass_fields__
    return Optimum(*(np.concatenate([getattr(optimum, name) for optimum in optima]) for name in names))


def _recalled(form: Form, limits: Array, solve: Callable[[], Optimum]) -> Optimum:
    ranges = [(way.low, way.high) for feature in form.features for way in feature.ways]

    def arrays() -> tuple[Array, ...]:
        optimum = solve()
        return tuple(getattr(optimum, name) for name in Optimum.__dataclass_fields__)

    return Optimum(*recalled((limits, *form.outputs, np.array(ranges)), arrays))


def _pointed(form: Form) -> bool:
    """Whether some feature has alternatives that are points: no tangent is near all of them."""
    return any(way.low == way.high for feature in form.features if len(feature.ways) > 1 for way in feature.ways)


def _least_cost(form: Form, limits: Array, near: Optimum | None) -> Optimum:
    """The search at sets of limits together, with the ways of a neighbour to begin with."""
    search = _Search(form, limits)
    every = np.ones(len(limits), dtype=bool)
    if near is not None and np.isfinite(near.cost[0]):
        search.start[:] = near.t[0]
        search.leaf(tuple(near.chosen[0].tolist()), every)
    search.leaf((0,) * len(form.features), ~np.isfinite(search.cost))
    if form.combinations > 1 and len(limits):
        search.leaf(tightest_ways(form), ~np.isfinite(search.cost) | (near is None))
        search.run()
    return Optimum(search.chosen, search.t, search.cost, search.bound, search.multiplier)


def _priced(form: Form) -> bool:
    """Whether a form of roots alone has curves that know their own prices (PricedCurve)."""
    curves = [way.curve for feature in form.features for way in feature.ways]
    return any(curve.priced for curve in curves) and separable(form)


def _by_squares(form: Form, limits: Array, watch: Watch) -> Optimum:
    """`least_cost` for roots of sums of squares, by prices of the squares."""
    squares, optima, floor = Squares(form), [Optimum.unknown(form, limits[:0])], cost_range(form)[0]
    known: Leaf | None = None
    for done, limit in enumerate(limits, 1):
        ways, t, mu, numbers = recalled((limit, *form.outputs), partial(_leaf_arrays, squares, limit, known))
        best = Leaf(tuple(ways.tolist()), t, float(numbers[0]), float(numbers[1]), mu)
        if np.isfinite(best.cost):
            known = best
        bound = min(max(float(numbers[2]), floor), best.cost)
        costs = np.array([best.cost]), np.array([bound])
        optima.append(Optimum(ways[None, :], t[None, :], *costs, (mu * squares.worth(limit))[None, :]))
        watch(optima[-1], done / len(limits))
    return _joined(optima)


def _leaf_arrays(squares: Squares, limit: Array, known: Leaf | None) -> tuple[Array | Integers, ...]:
    leaf, bound = least_leaf(squares, limit, known)
    return np.array(leaf.ways, dtype=np.int64), leaf.t, leaf.mu, np.array([leaf.cost, leaf.bound, bound])


def _by_master(form: Form, limits: Array) -> Optimum:
    """`least_cost` by a linear master problem, one set of limits after the other."""
    optimum = Optimum.unknown(form, limits)
    for row, limit in enumerate(limits):
        master = Master(form, limit, *cost_range(form))
        best = master.run()
        optimum.bound[row] = master.proven
        if best is not None:
            optimum.chosen[row], optimum.t[row] = best.chosen, best.t
            optimum.cost[row], optimum.bound[row] = best.cost, best.bound
    return optimum


@dataclass(eq=False)
class _Search:
    form: Form
    limits: Array
    leaves: int = 0
    solved: dict[tuple[int, ...], Flags] = field(default_factory=dict)
    tables: list[Array] = field(default_factory=list)
    open_: list[Array] = field(default_factory=list)
    received: Array = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        n, features = len(self.limits), len(self.form.features)
        self.separable = self.form.separable
        self.most = largest_parts(self.form) if self.form.quantiles else None
        self.chosen = np.zeros((n, features), dtype=np.int64)
        self.t, self.start = np.full((2, n, features), np.nan)
        self.multiplier = np.zeros_like(self.limits)
        self.cost, self.bound = np.full(n, np.inf), np.full(n, np.inf)
        self.factor, self.ascended = np.ones(n), np.full_like(self.limits, np.nan)
        self.floor, self.ceiling = cost_range(self.form)
        self.alike = _alike(self.form)
        self.least = None if compensating(self.form) else _Least.of(self.form)

    def leaf(self, chosen: tuple[int, ...], alive: Flags) -> None:
        """Solve a combination at the limits `alive`, except where it is solved already."""
        done = self.solved.setdefault(chosen, np.zeros(len(self.limits), dtype=bool))
        rows = np.flatnonzero(alive & ~done)
        if not len(rows):
            return
        self.leaves += 1
        done[rows] = True
        combination = Combination(self.form, chosen)
        if self.separable:
            solution = Path(combination).least_cost(self.limits[rows])
        else:
            starts = np.where(np.isnan(self.t[rows]), self.start[rows], self.t[rows])
            solution = Programme(combination).least_cost(self.limits[rows], starts)
        self.bound[rows] = np.minimum(self.bound[rows], solution.bound)
        improved = solution.cost < self.cost[rows]
        better = rows[improved]
        self.cost[better], self.t[better] = solution.cost[improved], solution.t[improved]
        self.chosen[better], self.multiplier[better] = chosen, solution.multiplier[improved]
        self.factor[better] = 1.0
        self.ascended[better] = np.nan

    # ---------------------------------------------------------------- bounds of nodes

    def tabulate(self) -> None:
        """Cost plus price of every way (ways, g, n) at a grid of prices around the best known."""
        multiplier = self._scaled_multipliers() * self.factor[:, None]
        self.tables, self.received = tabulated(self.form, GRID, multiplier, self.limits, self._spread())
        self.open_ = [np.zeros(self.received.shape)]
        for table in self.tables[::-1]:
            self.open_.insert(0, self.open_[0] + table.min(axis=0))

    def _spread(self) -> Spread:
        """S of the best known allocations, and its tangents; without one in the middle of the ranges."""
        middle = [0.5 * (feature.ways[0].low + feature.ways[0].high) for feature in self.form.features]
        return spread_at(self.form, self.chosen, np.where(np.isnan(self.t), middle, self.t), self.most)

    def _scaled_multipliers(self) -> Array:
        """The best known multipliers (n, r), those of other limits where none are known."""
        known = np.isfinite(self.cost) & np.any(self.multiplier > 0.0, axis=1)
        if known.any():
            usual = np.median(self.multiplier[known], axis=0)
        else:
            size = np.where(np.isfinite(self.limits), np.abs(self.limits), 0.0).max(axis=0)
            usual = (self.ceiling - self.floor) / np.where(size > 0.0, size, 1.0)
        multipliers = np.where(known[:, None], self.multiplier, usual)
        return np.asarray(np.where(np.isnan(self.ascended), multipliers, self.ascended))

    def _bounds(self, total: Array) -> Array:
        """Lower bounds (n,) from costs plus prices (g, n) of all features."""
        return np.asarray(self.form.base + np.max(less_rounding(total, self.received), axis=0))

    def run(self) -> None:
        """Branch and bound, begun from the ways that the prices choose."""
        for _ in range(PASSES):
            self.tabulate()
            at = np.argmax(self.open_[0] - self.received, axis=0)
            self.factor *= GRID[at]
            if not self._pick(at) and np.all((at > 0) & (at < len(GRID) - 1)):
                break
        if not self.separable:
            self._ascend()
        self.tabulate()
        nothing = np.zeros((len(GRID), len(self.limits)))
        self.node((), np.ones(len(self.limits), dtype=bool), nothing, self._bounds(self.open_[0]))

    def _ascend(self) -> None:
        """Improve the multipliers of every set of limits, and solve the ways that they choose."""
        for _ in range(ROUNDS):
            before, multiplier = self.cost.copy(), self._scaled_multipliers() * self.factor[:, None]
            spread = self._spread()
            for row, limit in enumerate(self.limits):
                ascent = Ascent(self.form, limit, rows_of(spread, np.array([row])))
                self.ascended[row] = ascent.multipliers(multiplier[row])
            self.factor[:] = 1.0
            kept = self.ascended.copy()
            self.tabulate()
            self._pick(np.argmax(self.open_[0] - self.received, axis=0))
            if not np.any(self.cost < before):
                self.ascended = kept
                return

    def _pick(self, at: Integers) -> bool:
        """Solve the ways chosen by the prices `at` each limit and the next prices; whether a cost fell.

        The ways at the best prices may break a limit that they keep on average.
        """
        columns, before = np.arange(len(self.limits)), self.cost.copy()
        for price in (at, np.minimum(at + 1, len(GRID) - 1)):
            chosen = np.stack([np.argmin(table, axis=0)[price, columns] for table in self.tables])
            ways, owner = np.unique(chosen, axis=1, return_inverse=True)
            for index, picked in enumerate(ways.T.tolist()):
                self.leaf(tuple(picked), np.ravel(owner) == index)
        return bool(np.any(self.cost < before))

    def node(self, ways: tuple[int, ...], alive: Flags, decided: Array, bounds: Array) -> None:
        """Enter a node at the limits where it may contain a cheaper allocation, best child first."""
        known = np.where(np.isfinite(self.cost), self.cost, 0.0)
        enter = alive & (bounds < self.cost - CLOSE * np.abs(known)) & (self.leaves < LEAVES)
        pruned = alive & ~enter
        self.bound[pruned] = np.minimum(self.bound[pruned], np.maximum(bounds[pruned], self.floor))
        if not np.any(enter):
            return
        if len(ways) == len(self.form.features):
            self.leaf(ways, enter)
            return
        children = []
        first = ways[-1] if self.alike[len(ways)] else 0
        for way in range(first, len(self.tables[len(ways)])):
            prefix, table = (*ways, way), self.tables[len(ways)][way]
            possible = enter if self.least is None else enter & self.least.keeps(prefix, self.limits)
            if np.any(possible):
                total = decided + table
                bound = self._bounds(total + self.open_[len(prefix)])
                children.append((float(bound[possible].mean()), prefix, possible, total, bound))
        for _, prefix, possible, total, bound in sorted(children, key=lambda child: child[:2]):
            self.node(prefix, possible, total, bound)


@dataclass(frozen=True, eq=False)
class _Least:
    """Least contributions of every way to r requirements: linear (ways, r) and squared (ways, r).

    `following` holds, from each feature on, the sums of the least contributions of those that
    follow.
    """

    form: Form
    linear: tuple[Array, ...]
    square: tuple[Array, ...]
    following: tuple[tuple[Array, Array], ...]

    @classmethod
    def of(cls, form: Form) -> _Least:
        """The contributions of a form that is not `compensating`.

        Squares add up only under roots: those of a quantile are not counted.
        """
        rooted = np.array([quantile is None for quantile in form.rows])
        pairs = [contributions(feature) for feature in form.features]
        linear = tuple(least_linear for least_linear, _ in pairs)
        square = tuple(np.where(rooted, least_square, 0.0) for _, least_square in pairs)
        rest = [(np.zeros(len(form.outputs)), np.zeros(len(form.outputs)))]
        for terms, squares in zip(linear[::-1], square[::-1], strict=True):
            rest.insert(0, (rest[0][0] + terms.min(axis=0), rest[0][1] + squares.min(axis=0)))
        return cls(form, linear, square, tuple(rest))

    def keeps(self, ways: tuple[int, ...], limits: Array) -> Flags:
        """Which limits (n, r) may be kept with the first features made in `ways`."""
        rest, further = self.following[len(ways)]
        linear = rest + sum((self.linear[at][way] for at, way in enumerate(ways)), np.zeros(1))
        square = further + sum((self.square[at][way] for at, way in enumerate(ways)), np.zeros(1))
        least = self.form.offset + linear + np.sqrt(self.form.constant + square)
        return np.asarray(np.all(least * (1.0 - np.sign(least) * ROUNDING) <= limits, axis=1))


def _alike(form: Form) -> list[bool]:
    """Which features are interchangeable with the feature before: their ways are tried in one order."""
    pairs = pairwise(form.features)
    same = [
        form.correlation is None and before.ways == feature.ways and before.count == feature.count
        for before, feature in pairs
    ]
    return [False, *same]


def compensating(form: Form) -> bool:
    """Whether deviations may compensate each other, so that contributions do not add up."""
    return form.correlation is not None and bool(np.any(form.correlation < 0.0))


def contributions(feature: Feature) -> tuple[Array, Array]:
    """Least linear and least squared contribution of each way, (ways, r) each."""
    linear = [
        np.minimum(np.multiply(way.linear, way.low), np.multiply(way.linear, way.high))
        + (np.array(way.offset) if way.offset else 0.0)
        for way in feature.ways
    ]
    square = [np.multiply(way.spread, way.low) ** 2 for way in feature.ways]
    return np.array(linear), np.array(square)


def tightest_ways(form: Form) -> tuple[int, ...]:
    """The ways of least contribution, in units of the range over the ways."""
    ways = []
    for feature in form.features:
        linear, square = contributions(feature)
        sizes = np.hstack([linear, np.sqrt(square)])
        span = np.ptp(sizes, axis=0)
        ways.append(int(np.argmin((sizes / np.where(span > 0.0, span, 1.0)).sum(axis=1))))
    return tuple(ways)


def cost_range(form: Form) -> tuple[float, float]:
    """Cost without any limit, and that of every feature at its most expensive."""
    ends = np.zeros(2)
    for feature in form.features:
        costs = [way.curve.cost(np.array([way.high, way.low])) for way in feature.ways]
        ends += feature.count * np.array([np.min(costs), np.max(costs)])
    return float(form.base + ends[0]), float(form.base + ends[1])
