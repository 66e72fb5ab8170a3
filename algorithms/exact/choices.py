"""Alternative ways of making a feature: branch and bound over them, for many limits at once.

Every node fixes the ways of the first features. Its bound is Lagrangian at a few prices around those
of the best known allocation: it is separable, so that every open feature has its best way. A node is
pruned at all limits where its bound shows that it cannot be cheaper; where no feature is open the
allocation is solved. At most `LEAVES` allocations are solved; nodes that are not entered count with
their bounds, so that the returned bound is always proven.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...journal import recall_arrays
from ...problems.forms import Feature, Form, Spread, largest_parts, spread_of
from ...problems.limits import EQUAL, LIMIT_ROUNDING, loosened
from ...problems.tolerance_problem import ToleranceProblem
from ...section import Array, Flags, Integers
from .combination import ROUNDING, Ascent, Combination, Path, less_rounding, rows_of, spread_at, tabulate_priced_costs
from .combination import Optimum as Optimum
from .programme import Programme
from .separable import Leaf, Squares, is_separable, is_separable_without_doubt, least_cost_under_doubt, least_leaf

# Many ways under several requirements: branch and bound on a linear master problem.
#
# A node allows some ways of every feature. Its relaxation mixes allocations: columns (feature, way,
# t), whose weights add up to one per feature, under tangent cuts of the requirements (Dantzig & Wolfe
# 1960; Kelley 1960). The prices of the cuts give a Lagrangian bound, separable and valid whatever the
# linear programme returns; they show which columns are missing, and the mean allocation shows which cuts.
# Columns and cuts serve all nodes. Branching is on the feature whose ways are mixed most.


GAP = 1e-4
"""Relative gap at which the search ends."""
SAMPLED = 5
"""Tolerances at which two cost curves are compared."""
NODES, MASTER_ROUNDS = 60, 60
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
            first = _heaviest_way(weight[at], allowed[at])
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
        for _ in range(MASTER_ROUNDS):
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
        scale = np.maximum(np.abs(room), EQUAL * np.max(np.abs(parts), axis=1, initial=0.0))
        scale[scale == 0.0] = 1.0
        price = PENALTY * (max(self.ceiling - self.floor, EQUAL * abs(self.ceiling)) or 1.0)
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
        heavy = tuple(map(_heaviest_way, weight, allowed))
        tight = tuple(map(_tightest_way, self.form.features, weight, allowed, heavy))
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


def _heaviest_way(weight: Array, ways: tuple[int, ...]) -> int:
    """The way of most weight among some; after a linear programme that failed all weights are 0."""
    return max(ways, key=weight.tolist().__getitem__)


def _tightest_way(feature: Feature, weight: Array, ways: tuple[int, ...], default: int) -> int:
    """The way with the least lower end of its range, of those that have weight."""
    mixed = (way for way in ways if weight[way] > 1e-6)
    return min(mixed, default=default, key=lambda way: feature.ways[way].low)


# Features that may change places: with their ways and tolerances exchanged an allocation costs the same
# and has the same requirements, so that nothing but rounding would decide between the two.


def interchangeable_features(form: Form) -> list[list[int]]:
    """Groups of features with several ways that may change places in a form."""
    several = [at for at, feature in enumerate(form.features) if len(feature.ways) > 1]
    if len(several) < 2:
        return []
    coefficients = [_coefficients(feature, len(form.outputs)) for feature in form.features]
    rounding = EQUAL * np.max([np.abs(own).max(axis=0) for own in coefficients], axis=0)
    costs = {at: _costs_of_ways(form.features[at]) for at in several}
    groups: list[list[int]] = []
    for at in several:
        for group in groups:
            pair = [coefficients[group[0]], coefficients[at]]
            if (
                _made_alike(form.features[group[0]], form.features[at])
                and np.all(np.abs(costs[group[0]] - costs[at]) <= EQUAL * np.abs(costs[group[0]]))
                and np.all(np.abs(np.subtract(*pair)) <= rounding)
                and _scatter_alike(form, group[0], at)
            ):
                group.append(at)
                break
        else:
            groups.append([at])
    return [group for group in groups if len(group) > 1]


def _coefficients(feature: Feature, rows: int) -> Array:
    """m, a and o of every way, (ways, 3, rows)."""
    nothing, names = (0.0,) * rows, ("linear", "spread", "offset")
    return np.array([[getattr(way, name) or nothing for name in names] for way in feature.ways])


def _made_alike(one: Feature, other: Feature) -> bool:
    """Whether two features are as many parts with the same ranges."""
    ranges, others = ([(way.low, way.high) for way in feature.ways] for feature in (one, other))
    return one.count == other.count and ranges == others


def _costs_of_ways(feature: Feature) -> Array:
    """Costs (ways, `SAMPLED`) along the range of every way."""
    return np.array([way.curve.cost(np.linspace(way.low, way.high, SAMPLED)) for way in feature.ways])


def _scatter_alike(form: Form, first: int, second: int) -> bool:
    """Whether two features have the same laws, correlations with the others, and uncertain processes."""
    order = np.arange(len(form.features))
    order[[first, second]] = second, first
    if form.correlation is not None and np.any(
        np.abs(form.correlation[np.ix_(order, order)] - form.correlation) > EQUAL
    ):
        return False
    uncertain = [surplus for surplus in form.surpluses if surplus is not None]
    shares = [share for s in uncertain for share in (s.own, s.shared, s.error) if share is not None]
    return all(q is None or q.pieces[first] == q.pieces[second] for q in form.quantiles) and all(
        abs(share[first] - share[second]) <= EQUAL * np.max(np.abs(share)) for share in shares
    )


def in_order(groups: list[list[int]], optimum: Optimum) -> Optimum:
    """The optima with the ways of interchangeable features in ascending order."""
    chosen, t = optimum.chosen.copy(), optimum.t.copy()
    for group in groups:
        order = np.argsort(chosen[:, group], axis=1, kind="stable")
        chosen[:, group] = np.take_along_axis(chosen[:, group], order, axis=1)
        t[:, group] = np.take_along_axis(t[:, group], order, axis=1)
    return replace(optimum, chosen=chosen, t=t)


# From allocations of a form to designs of its problem.


def best_search_vectors(problem: ToleranceProblem, form: Form, optimum: Optimum) -> Array:
    """`search_vectors` with interchangeable features in the places that are best by the full model.

    An output that a requirement stands for, or bounds, may differ between the places, at equal cost.
    Pairs change places as long as this keeps the limits better or lowers an objective, or, where all
    are equal, leaves the limits more room.
    """
    optimum = optimum.at(np.flatnonzero(np.isfinite(optimum.cost)))
    x, groups = search_vectors(problem, form, optimum), [] if form.exact else interchangeable_features(form)
    ranked = _ranked(problem, x) if groups and len(x) else np.empty((0, 1))
    for group in groups:
        for _ in group[1:]:
            before = x.copy()
            for places in combinations(group, 2):
                rows = np.flatnonzero(optimum.chosen[:, places[0]] != optimum.chosen[:, places[1]])
                other = optimum.at(rows)
                other.chosen[:, places], other.t[:, places] = other.chosen[:, places[::-1]], other.t[:, places[::-1]]
                tried = search_vectors(problem, form, other)
                tried_ranked = _ranked(problem, tried) if len(rows) else ranked[:0]
                better = _precedes(tried_ranked, ranked[rows])
                kept = rows[better]
                x[kept], ranked[kept] = tried[better], tried_ranked[better]
                optimum.chosen[kept], optimum.t[kept] = other.chosen[better], other.t[better]
            if np.array_equal(x, before):
                break
    return x


def _ranked(problem: ToleranceProblem, x: Array) -> Array:
    """What decides between designs of equal cost, (n, k), the first column first."""
    f, g = problem.tested(x)
    room = g.max(axis=1, initial=-np.inf)[:, None]
    return np.hstack([np.maximum(room, 0.0), f, np.where(np.isfinite(room), room, 0.0)])


def _precedes(one: Array, other: Array) -> Flags:
    """Which rows (n,) of `one` (n, k) are less by more than rounding in the first column that differs."""
    differs = np.abs(one - other) > LIMIT_ROUNDING * np.maximum(np.abs(one), np.abs(other))
    first, rows = np.argmax(differs, axis=1), np.arange(len(one))
    return np.asarray(differs[rows, first] & (one[rows, first] < other[rows, first]))


def search_vectors(problem: ToleranceProblem, form: Form, optimum: Optimum) -> Array:
    """Search vectors (k, free variables) of the allocations that exist, within the bounds."""
    real = np.isfinite(optimum.cost)
    columns = {name: np.full(int(real.sum()), value) for name, value in form.settled.items()}
    for at, feature in enumerate(form.features):
        if feature.variable:
            columns[feature.variable] = optimum.t[real, at]
        if feature.choice:
            choices = np.array([way.choice for way in feature.ways])
            columns[feature.choice] = choices[optimum.chosen[real, at]]
    columns = problem.form_columns(columns)
    x = np.stack([columns[variable.name] for variable in problem.free], axis=1)
    return np.asarray(np.clip(x, problem.xl, problem.xu))


def search_vector(problem: ToleranceProblem, form: Form, ways: tuple[int, ...], t: Array) -> Array:
    """The search vector (1, free variables) of one allocation: ways and tolerances (features,)."""
    nothing = np.zeros(1)
    optimum = Optimum(np.array([ways]), t[None, :], nothing, nothing, nothing[:, None])
    return search_vectors(problem, form, optimum)


# Forms of points alone: all choices of ways are computed, and the cheapest feasible choice counts.
#
# Grades, and machines without inspection, have no tolerance to search. Forms of such parts alone have
# few choices. Prices of the squares cannot separate them under doubt of their scatter, and limits of a
# form that is a bound exclude choices that the full model allows: there that model decides.


MAX_COMBINATIONS = 300_000
"""Choices of ways that are computed at most."""
FIRST, BATCH, TESTED = 8, 256, 16_384
"""Choices that the full model computes first, at once, and at most."""
COST_TIE_TOLERANCE = 1e-12
"""Relative difference of costs that is rounding."""


def has_only_point_ways(form: Form) -> bool:
    """Whether all ways of a form are points, and few enough to compute all choices."""
    points = all(way.low == way.high for feature in form.features for way in feature.ways)
    return points and form.combinations <= MAX_COMBINATIONS


def is_enumerable_root_form(form: Form) -> bool:
    """Whether a form is of `has_only_point_ways`, and of roots: the values of all choices follow from sums."""
    return has_only_point_ways(form) and form.joint is None and form.correlation is None


def cheapest_choice(problem: ToleranceProblem, form: Form, upper: Array, floor: float) -> Array | None:
    """The search vector (at most one) of the cheapest choice that keeps the limits by the full model.

    Choices beyond upper limits (r,) of the form, or cheaper than a proven `floor`, are none. Of those
    of one cost the one with most room counts. None where too many would have to be computed.
    """
    cost, values = _all_choices(form)
    by_sums = np.array([quantile is None and form.correlation is None for quantile in form.rows])
    fits = np.all(values[by_sums] <= loosened(upper, 2.0)[by_sums, None], axis=0)
    fits &= cost >= floor - COST_TIE_TOLERANCE * abs(floor)
    order = np.flatnonzero(fits)
    order = order[np.argsort(cost[order], kind="stable")]
    done, x = 0, np.empty((0, problem.n_var))
    while done < min(len(order), TESTED):
        rows = order[done : done + (BATCH if done else FIRST)]
        last = cost[rows[-1]] * (1.0 + COST_TIE_TOLERANCE * np.sign(cost[rows[-1]]))
        rows = order[done : max(done + len(rows), int(np.searchsorted(cost[order], last, side="right")))]
        x = search_vectors(problem, form, _optima_of_choices(form, rows, cost))
        violations = problem.tested(x)[1].max(axis=1, initial=-np.inf)
        if np.any(kept := violations <= 0.0):
            first = cost[rows[int(np.argmax(kept))]]
            same = kept & (cost[rows] - first <= COST_TIE_TOLERANCE * abs(first))
            at = int(np.argmin(np.where(same, violations, np.inf)))
            return x[at : at + 1]
        done += len(rows)
    return x[:0] if done >= len(order) else None


def _optima_of_choices(form: Form, rows: Integers, cost: Array) -> Optimum:
    """Choices by number as optima; their costs are their own bounds."""
    shape = tuple(len(feature.ways) for feature in form.features)
    ways = np.stack(np.unravel_index(rows, shape), axis=1).astype(np.int64)
    low = [np.array([way.low for way in feature.ways])[ways[:, at]] for at, feature in enumerate(form.features)]
    return Optimum(ways, np.stack(low, axis=1), cost[rows], cost[rows], np.zeros((len(rows), len(form.outputs))))


def cheapest_choice_within_limits(form: Form, limits: Array) -> Optimum:
    """The cheapest choice that keeps each set of upper limits (n, r); its cost is its own bound.

    Cost and bound are inf where none keeps them.
    """
    cost, values = _all_choices(form)
    order = np.argsort(cost, kind="stable")
    optimum = Optimum.unknown(form, limits)
    for row, limit in enumerate(limits):
        fits = np.all(values[:, order] <= limit[:, None], axis=0)
        if not np.any(fits):
            continue
        best = _optima_of_choices(form, order[[int(np.argmax(fits))]], cost)
        optimum.chosen[row], optimum.t[row] = best.chosen[0], best.t[0]
        optimum.cost[row] = optimum.bound[row] = best.cost[0]
    return optimum


def _all_choices(form: Form) -> tuple[Array, Array]:
    """Cost (m,) and requirements (r, m) of every choice, the last feature changing fastest.

    Those that are no roots of sums mean nothing.
    """
    cost, linear = np.full(1, form.base), form.offset[:, None].copy()
    square = form.constant[:, None].copy()
    for feature in form.features:
        costs, ends, squares = _points(feature, len(form.outputs))
        cost = np.add.outer(cost, costs).ravel()
        linear, square = _outer(linear, ends), _outer(square, squares)
    shape = tuple(len(feature.ways) for feature in form.features)
    ways = np.unravel_index(np.arange(len(cost)), shape)
    for row, surplus in enumerate(form.surpluses):
        if surplus is not None:
            way_squares = [
                _points(feature, len(form.outputs))[2][row, way]
                for feature, way in zip(form.features, ways, strict=True)
            ]
            square[row] += surplus.value(np.stack(way_squares, axis=1))[0]
    return cost, linear + np.sqrt(square)


def _outer(sums: Array, more: Array) -> Array:
    """All sums (r, m w) of the sums (r, m) and the contributions (r, w) of a further feature's ways."""
    return np.asarray((sums[:, :, None] + more[:, None, :]).reshape(len(sums), -1))


def _points(feature: Feature, rows: int) -> tuple[Array, Array, Array]:
    """Cost (w,), linear terms and squares (r, w) of the ways of a feature."""
    t = np.array([way.low for way in feature.ways])
    cost = np.array([float(way.curve.cost(t[at : at + 1])[0]) for at, way in enumerate(feature.ways)])
    linear = np.array([way.linear for way in feature.ways]).T * t
    offset = np.array([way.offset or (0.0,) * rows for way in feature.ways]).T
    square = (np.array([way.spread for way in feature.ways]).T * t) ** 2
    return feature.count * cost, linear + offset, square


Watch = Callable[[Optimum, float], None]
"""Called with optima as they are solved, and the fraction of all that is solved."""


def ignore_progress(optimum: Optimum, share: float) -> None:
    """Do nothing with what is solved."""


GRID = np.unique(np.concatenate([np.geomspace(0.02, 50.0, 15), np.geomspace(0.7, 1.4, 13)]))
"""Prices at which nodes are bounded, in units of the best known allocation's own."""
PASSES = 8
"""Times the prices are improved at most before the search."""
ROUNDS = 4
"""Times all multipliers are improved at most, each after a better allocation."""
LEAVES = 4096
"""Allocations that are solved at most."""
MAX_UNPRICED_COMBINATIONS = 1000
"""Combinations of ways from which on prices of squares exclude most of them at once."""
MAX_SOLVED_COMBINATIONS = 4
"""Combinations of ways of one requirement up to which each is solved: bounds of nodes take as long as a few."""
MIXED = 5
"""Features with several ways from which on quantiles are searched by a linear master problem."""
COST_GAP_TOLERANCE = 1e-10
"""A node whose bound is this close to the best cost cannot improve it noticeably."""


def least_cost(form: Form, limits: Array, watch: Watch = ignore_progress) -> Optimum:
    """The cheapest allocation that keeps each set of upper limits (n, r) of a form.

    Cost and bound are inf where no allocation can keep them, the cost alone where none is known.
    `watch` is called with what is solved, and its fraction of the whole. The ways of interchangeable
    features are in ascending order.
    """
    groups = interchangeable_features(form)
    optimum = _least_costs(form, np.asarray(limits, dtype=float), lambda o, share: watch(in_order(groups, o), share))
    return in_order(groups, optimum)


def _least_costs(form: Form, limits: Array, watch: Watch) -> Optimum:
    """`least_cost` by the method that suits the form."""
    if form.quantiles and sum(len(feature.ways) > 1 for feature in form.features) >= MIXED:
        return _solve_limits_in_turn(form, limits, watch, lambda limit, _: _least_cost_by_master(form, limit))
    if is_enumerable_root_form(form):
        return _solve_all_limits(form, limits, watch, partial(cheapest_choice_within_limits, form, limits))
    if is_separable_without_doubt(form) and not _has_point_alternatives(form):
        return _solve_all_limits(
            form, limits, watch, partial(least_cost_under_doubt, form, limits, cost_range(form)[0])
        )
    several = len(form.outputs) > 1
    if (several or form.combinations > MAX_UNPRICED_COMBINATIONS) and _has_priced_curves(form):
        return _least_cost_by_squares(form, limits, watch)
    if form.combinations == 1 or form.separable or len(limits) < 2:
        return _solve_all_limits(form, limits, watch, partial(_least_cost, form, limits, None))
    # multipliers of several requirements are improved for each alone
    return _solve_limits_in_turn(form, limits, watch, lambda limit, previous: _least_cost(form, limit, previous))


def _solve_all_limits(form: Form, limits: Array, watch: Watch, solve: Callable[[], Optimum]) -> Optimum:
    """What `solve` returns for all limits, unless it was solved before."""
    optimum = _recall_optimum(form, limits, solve)
    watch(optimum, 1.0)
    return optimum


def _solve_limits_in_turn(
    form: Form, limits: Array, watch: Watch, solve: Callable[[Array, Optimum | None], Optimum]
) -> Optimum:
    """What `solve` returns for one set of limits (1, r) after the other, next to the one before."""
    optima: list[Optimum] = []
    for done, limit in enumerate(limits, 1):
        solved = partial(solve, limit[None, :], optima[-1] if optima else None)
        optima.append(_recall_optimum(form, limit, solved))
        watch(optima[-1], done / len(limits))
    return _stack_optima([Optimum.unknown(form, limits[:0]), *optima])


def _stack_optima(optima: list[Optimum]) -> Optimum:
    """The optima below each other."""
    names = Optimum.__dataclass_fields__
    return Optimum(*(np.concatenate([getattr(optimum, name) for optimum in optima]) for name in names))


def _recall_optimum(form: Form, limits: Array, solve: Callable[[], Optimum]) -> Optimum:
    def arrays() -> tuple[Array, ...]:
        optimum = solve()
        return tuple(getattr(optimum, name) for name in Optimum.__dataclass_fields__)

    return Optimum(*recall_arrays(_marks(form, limits), arrays))


def _marks(form: Form, limits: Array) -> Iterator[Array | str]:
    """What distinguishes a solution from those of other limits, and of forms of one problem with other curves.

    Computed only where a section is open.
    """
    yield limits
    yield from form.outputs
    for way in (way for feature in form.features for way in feature.ways):
        ends = np.array([way.low, way.high])
        yield np.concatenate([ends, way.curve.cost(ends)])


def _has_point_alternatives(form: Form) -> bool:
    """Whether some feature has alternatives that are points: no tangent is near all of them."""
    return any(way.low == way.high for feature in form.features if len(feature.ways) > 1 for way in feature.ways)


def _least_cost(form: Form, limits: Array, near: Optimum | None) -> Optimum:
    """The search at sets of limits together, with the ways of a neighbour to begin with."""
    search = _Search(form, limits)
    every = np.ones(len(limits), dtype=bool)
    if near is not None and np.isfinite(near.cost[0]):
        search.start[:] = near.t[0]
        search.leaf(tuple(near.chosen[0].tolist()), every)
    if form.separable and form.combinations <= MAX_SOLVED_COMBINATIONS:
        for ways in form.choices():
            search.leaf(ways, every)
        return Optimum(search.chosen, search.t, search.cost, search.bound, search.multiplier)
    search.leaf((0,) * len(form.features), ~np.isfinite(search.cost))
    if form.combinations > 1 and len(limits):
        search.leaf(tightest_ways(form), ~np.isfinite(search.cost) | (near is None))
        search.run()
    return Optimum(search.chosen, search.t, search.cost, search.bound, search.multiplier)


def _has_priced_curves(form: Form) -> bool:
    """Whether a form of roots alone has curves that know their own prices (PricedCurve)."""
    curves = [way.curve for feature in form.features for way in feature.ways]
    return any(curve.priced for curve in curves) and is_separable(form)


def _least_cost_by_squares(form: Form, limits: Array, watch: Watch) -> Optimum:
    """`least_cost` for roots of sums of squares, by prices of the squares."""
    squares, optima, floor = Squares(form), [Optimum.unknown(form, limits[:0])], cost_range(form)[0]
    known: Leaf | None = None
    for done, limit in enumerate(limits, 1):
        ways, t, mu, numbers = recall_arrays(_marks(form, limit), partial(_leaf_arrays, squares, limit, known))
        best = Leaf(tuple(ways.tolist()), t, float(numbers[0]), float(numbers[1]), mu)
        if np.isfinite(best.cost):
            known = best
        bound = min(max(float(numbers[2]), floor), best.cost)
        costs = np.array([best.cost]), np.array([bound])
        optima.append(Optimum(ways[None, :], t[None, :], *costs, (mu * squares.worth(limit))[None, :]))
        watch(optima[-1], done / len(limits))
    return _stack_optima(optima)


def _leaf_arrays(squares: Squares, limit: Array, known: Leaf | None) -> tuple[Array | Integers, ...]:
    leaf, bound = least_leaf(squares, limit, known)
    return np.array(leaf.ways, dtype=np.int64), leaf.t, leaf.mu, np.array([leaf.cost, leaf.bound, bound])


def _least_cost_by_master(form: Form, limits: Array) -> Optimum:
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
        self.alike = _repeated_features(self.form)
        self.least = None if has_compensation(self.form) else _Least.of(self.form)

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
        self.tables, self.received = tabulate_priced_costs(self.form, GRID, multiplier, self.limits, self._spread())
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
        enter = alive & (bounds < self.cost - COST_GAP_TOLERANCE * np.abs(known)) & (self.leaves < LEAVES)
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
        """The contributions of a form that is not `has_compensation`.

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


def _repeated_features(form: Form) -> list[bool]:
    """Which features are interchangeable with the feature before: their ways are tried in one order."""
    pairs = pairwise(form.features)
    same = [
        form.correlation is None and before.ways == feature.ways and before.count == feature.count
        for before, feature in pairs
    ]
    return [False, *same]


def has_compensation(form: Form) -> bool:
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
