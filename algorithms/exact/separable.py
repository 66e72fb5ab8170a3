"""Requirements that are roots of sums of squares alone: separable at prices of their squares.

Cost and squares are sums over the features, so that at prices mu_i of the squares every tolerance
is the best on its own, and the dual

    g(mu) = sum_j min_t [C_j(t) + q_j t^2] - sum_i mu_i (L_i^2 - constant_i)
    q_j   = sum_i mu_i a_ij^2

has the slope sum_j a_ij^2 t_j^2 + constant_i - L_i^2. With one way per feature its maximum is the
least cost, found by Newton's method in ln mu. Its prices bound all other choices of ways at once:
every way has an excess cost over the chosen one, and a choice is solved only where the bound plus
its excess is below the best cost known.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from heapq import heappop, heappush

import numpy as np

from ...models.costs import Reciprocal
from ...problems.forms import Form
from ...section import Array, Flags
from .combination import ROUNDING, Combination, Optimum, pure_root_rows
from .slsqp import ascend

STEPS = 60
LIMIT_TOLERANCE = 1e-13
"""Relative distance of a square from its limit that counts as none."""
MIN_PRICE_FRACTION = 1e-12
"""Price, relative to the largest cost per room of the limit, below which a requirement does not
bind."""
NUDGE = 1e-6
"""Relative step of the derivative of a tolerance by its price."""
ROUNDS = 12
"""Times the ways are chosen again by the prices of the best allocation."""
LEAVES = 400
"""Choices of ways that are solved at most for one set of limits."""


def is_separable(form: Form) -> bool:
    """Whether all requirements are roots alone, and all costs positive functions of one price."""
    return bool(np.all(pure_root_rows(form)))


def is_separable_without_doubt(form: Form) -> bool:
    """Whether the form has surpluses by the doubt of its processes, all convex in the squares, and
    would be `is_separable` without them.
    """
    convex = all(surplus is None or surplus.convex for surplus in form.surpluses)
    return bool(form.surpluses) and convex and is_separable(replace(form, surpluses=()))


@dataclass(frozen=True, slots=True, eq=False)
class Leaf:
    """One choice of ways at one set of limits: tolerances (features,), cost, bound, prices (r,) of
    the squares. Cost and bound are inf where no tolerances keep the limits.
    """

    ways: tuple[int, ...]
    t: Array
    cost: float
    bound: float
    mu: Array


class Squares:
    """A form's features as arrays, for one set of limits after the other.

    `weights` (r, features) multiply the squares, `constant` (r,) stands for that of the form.
    """

    def __init__(self, form: Form, weights: Array | None = None, constant: Array | None = None) -> None:
        self.form = form
        self.counts = np.array([float(feature.count) for feature in form.features])
        self.squares = [np.array([way.spread for way in f.ways]) ** 2 for f in form.features]
        if weights is not None:
            self.squares = [square * weights[:, at] for at, square in enumerate(self.squares)]
        self.constant = form.constant if constant is None else constant

    @cached_property
    def several(self) -> list[int]:
        """Features that can be made in several ways."""
        return [at for at, f in enumerate(self.form.features) if len(f.ways) > 1]

    def room(self, limit: Array) -> Array:
        """The largest allowed sums of squares (r,); inf without a limit."""
        room = np.maximum(limit - self.form.offset, 0.0) ** 2 - self.constant
        return np.where(np.isfinite(limit), room, np.inf)

    def worth(self, limit: Array) -> Array:
        """Derivative of the room (r,) by the limit; 0 without one."""
        room = limit - self.form.offset
        return np.where(np.isfinite(limit), 2.0 * np.where(np.isfinite(room), room, 0.0), 0.0)

    def solve(self, ways: tuple[int, ...], room: Array, first: Array | None) -> Leaf:
        """The least cost of one choice of ways."""
        return _Choice(self, ways).solve(room, first)

    def excess(self, leaf: Leaf) -> list[Array]:
        """Excess cost (ways,) of the ways of each feature over the leaf's way, prices included."""
        excesses = []
        for at, feature in enumerate(self.form.features):
            if len(feature.ways) == 1:
                excesses.append(np.zeros(1))
                continue
            values = []
            for way, square in zip(feature.ways, self.squares[at], strict=True):
                q = np.array([leaf.mu @ square])
                nothing = np.zeros(1)
                t = way.curve.best(nothing, q / self.counts[at], way.low, way.high)
                values.append(float((self.counts[at] * way.curve.cost(t) + q * t**2)[0]))
            excesses.append(np.array(values) - values[leaf.ways[at]])
        return excesses


class _Choice:
    """One way per feature."""

    def __init__(self, parent: Squares, ways: tuple[int, ...]) -> None:
        form = parent.form
        self.chosen, self.counts, self.base = ways, parent.counts, form.base
        chosen_ways = [f.ways[w] for f, w in zip(form.features, ways, strict=True)]
        self.curves = [way.curve for way in chosen_ways]
        self.low = np.array([way.low for way in chosen_ways])
        self.high = np.array([way.high for way in chosen_ways])
        self.square = np.stack([s[w] for s, w in zip(parent.squares, ways, strict=True)], axis=1)
        plain = [isinstance(curve, Reciprocal) for curve in self.curves]
        self.plain = np.flatnonzero(plain)
        self.other = np.flatnonzero(~np.array(plain))
        pairs = [(c.a, c.b) for c in self.curves if isinstance(c, Reciprocal)]
        self.a, self.b = np.array(pairs).reshape(-1, 2).T

    def best(self, q: Array) -> tuple[Array, Array]:
        """Tolerances (features,) at prices q of their squares, and their derivatives by ln q."""
        t, slope = np.empty(len(q)), np.zeros(len(q))
        at = self.plain
        with np.errstate(divide="ignore"):
            free = np.cbrt(self.b * self.counts[at] / (2.0 * q[at]))
        t[at] = np.clip(free, self.low[at], self.high[at])
        slope[at] = np.where(t[at] == free, -free / 3.0, 0.0)
        for index in self.other:
            pair = np.array([q[index], q[index] * (1.0 + NUDGE)]) / self.counts[index]
            tolerances = self.curves[index].best(np.zeros(2), pair, self.low[index], self.high[index])
            t[index], slope[index] = tolerances[0], (tolerances[1] - tolerances[0]) / NUDGE
        return t, slope

    def cost(self, t: Array) -> float:
        """Cost of tolerances (features,)."""
        costs = np.empty(len(t))
        costs[self.plain] = self.a + self.b / t[self.plain]
        for index in self.other:
            costs[index] = self.curves[index].cost(t[index : index + 1])[0]
        return float(self.base + self.counts @ costs)

    def dual(self, mu: Array, room: Array) -> float:
        """A proven lower bound of the cost at prices (r,)."""
        q = mu @ self.square
        t, _ = self.best(q)
        priced, received = q @ t**2, mu @ np.where(mu > 0.0, room, 0.0)
        cost = self.cost(t)
        return float(cost + priced - received - ROUNDING * (abs(cost) + priced + received))

    def solve(self, room: Array, first: Array | None) -> Leaf:
        nothing, least = np.zeros(len(room)), self.square @ self.low**2
        asked = np.isfinite(room) & (least > 0.0)  # a requirement that no tolerance moves has no price
        if np.any(least > room * (1.0 + 1e-12)):
            return Leaf(self.chosen, self.low, np.inf, np.inf, nothing)
        if np.all(self.square @ self.high**2 <= room):
            cost = self.cost(self.high)
            return Leaf(self.chosen, self.high, cost, cost, nothing)
        mu = self._newton(room, asked, first)
        t = self._moved_within_room(self.best(mu @ self.square)[0], room)
        cost, bound = self.cost(t), self.dual(mu, room)
        if cost - bound > 1e-9 * abs(cost):
            ascended = self._ascended(room, asked)
            for better in (ascended, self._newton(room, asked & (ascended > 0.0), ascended)):
                candidate = self._moved_within_room(self.best(better @ self.square)[0], room)
                candidate_cost, candidate_bound = self.cost(candidate), self.dual(better, room)
                if candidate_bound > bound:
                    mu, bound = better, candidate_bound
                if candidate_cost < cost:
                    t, cost = candidate, candidate_cost
        return Leaf(self.chosen, t, cost, min(bound, cost), mu)

    def _newton(self, room: Array, asked: Flags, first: Array | None) -> Array:
        """Prices (r,) at which every square meets its room or its price is zero."""
        scale = self.cost(self.low) / np.where(asked, room, 1.0)
        start = 1e-2 * scale if first is None else np.maximum(first, MIN_PRICE_FRACTION * scale)
        y = np.where(asked, np.log(start), -np.inf)
        floor = np.log(MIN_PRICE_FRACTION * scale)
        active = asked.copy()
        with np.errstate(divide="ignore", invalid="ignore"):
            for _ in range(STEPS):
                mu = np.where(active, np.exp(y), 0.0)
                q = mu @ self.square
                t, slope = self.best(q)
                size = self.square @ t**2
                missed = np.where(asked, np.log(size / room), 0.0)
                # a broken requirement without a price gets a price again
                back = asked & ~active & (missed > LIMIT_TOLERANCE)
                y, active = np.where(back, floor + 1.0, y), active | back
                if np.all(np.abs(missed[active]) <= LIMIT_TOLERANCE):
                    break
                rows = np.flatnonzero(active)
                inverse = np.where(q > 0.0, 1.0 / q, 0.0)
                by = (self.square[rows] * (2.0 * t * slope * inverse)) @ self.square[rows].T
                matrix = by * mu[rows] / size[rows, None]
                matrix -= 1e-12 * np.eye(len(rows)) * max(1.0, float(np.abs(matrix).max()))
                step = np.linalg.lstsq(matrix, -missed[rows], rcond=None)[0]
                y = y.copy()
                y[rows] += np.clip(step, -3.0, 3.0)
                active = active & (y >= floor)
        return np.where(active, np.exp(y), 0.0)

    def _ascended(self, room: Array, asked: Flags) -> Array:
        """Prices by the maximum of the dual, where Newton's method fails: the dual is concave in
        them, and has a slope also where a price is zero.
        """
        scale = self.cost(self.low) / np.where(asked, room, 1.0)

        def dual(x: Array) -> tuple[float, Array]:
            mu = np.where(asked, x * scale, 0.0)
            t, _ = self.best(mu @ self.square)
            slope = np.where(asked, self.square @ t**2 - np.where(asked, room, 0.0), 0.0)
            return self.dual(mu, room), slope * scale

        start = np.full(len(room), 1e-2)
        x = ascend(dual, start, 1e6, slopes=True, ftol=1e-16, gtol=1e-12, maxiter=500)
        return np.where(asked, x * scale, 0.0)

    def _moved_within_room(self, t: Array, room: Array) -> Array:
        """Tolerances just within the room: those that matter are moved towards the tightest."""
        broken = self.square @ t**2 > room
        if not np.any(broken):
            return t
        low, high = 0.0, 1.0
        matters = np.any(self.square[broken] > 0.0, axis=0)
        for _ in range(60):
            middle = 0.5 * (low + high)
            tried = np.where(matters, self.low + middle * (t - self.low), t)
            kept = np.all(self.square @ tried**2 <= room)
            low, high = (middle, high) if kept else (low, middle)
        return np.where(matters, self.low + low * (t - self.low), t)


def least_leaf(squares: Squares, limit: Array, known: Leaf | None) -> tuple[Leaf, float]:
    """The cheapest leaf at limits (r,), and a bound over all choices of ways."""
    room = squares.room(limit)
    ways = tuple(int(np.argmin([way.low for way in feature.ways])) for feature in squares.form.features)
    best = squares.solve(ways, room, None if known is None else known.mu)
    solved = {best.ways: best}
    if known is not None and known.ways not in solved:
        leaf = squares.solve(known.ways, room, known.mu)
        solved[leaf.ways] = leaf
        best = min(best, leaf, key=lambda candidate: candidate.cost)
    if not np.isfinite(best.cost):
        return best, _infeasibility_bound(squares, room)
    for _ in range(ROUNDS):
        chosen = tuple(int(np.argmin(way_excess)) for way_excess in squares.excess(best))
        if chosen in solved:
            break
        solved[chosen] = squares.solve(chosen, room, best.mu)
        if not solved[chosen].cost < best.cost:
            break
        best = solved[chosen]
    return _search_remaining_choices(squares, room, best, solved)


def _search_remaining_choices(
    squares: Squares, room: Array, best: Leaf, solved: dict[tuple[int, ...], Leaf]
) -> tuple[Leaf, float]:
    """Solve every choice that the prices of the best leaf do not exclude."""
    excess, anchor, remaining = squares.excess(best), best, np.inf
    for total, ways in _choices_by_excess(squares, excess, anchor):
        if anchor.bound + total >= best.cost or len(solved) >= LEAVES:
            remaining = anchor.bound + total
            break
        if ways not in solved:
            solved[ways] = squares.solve(ways, room, anchor.mu)
            if solved[ways].cost < best.cost:
                best = solved[ways]
    bounds = [leaf.bound for leaf in solved.values()]
    return best, min(remaining, best.cost, *bounds)


def _choices_by_excess(squares: Squares, excess: list[Array], anchor: Leaf) -> Iterator[tuple[float, tuple[int, ...]]]:
    """Choices of ways with their excess over the anchor, the least first."""
    several = squares.several
    order = [np.argsort(excess[at], kind="stable") for at in several]
    begin: tuple[int, ...] = (0,) * len(several)

    def total(rank: tuple[int, ...]) -> float:
        return float(sum(excess[at][o[k]] for at, o, k in zip(several, order, rank, strict=True)))

    heap: list[tuple[float, tuple[int, ...]]] = [(total(begin), begin)]
    queued: set[tuple[int, ...]] = {begin}
    while heap:
        value, rank = heappop(heap)
        ways = list(anchor.ways)
        for at, o, k in zip(several, order, rank, strict=True):
            ways[at] = int(o[k])
        yield value, tuple(ways)
        for at in range(len(rank)):
            if rank[at] + 1 < len(order[at]):
                further = (*rank[:at], rank[at] + 1, *rank[at + 1 :])
                if further not in queued:
                    queued.add(further)
                    heappush(heap, (total(further), further))


def _infeasibility_bound(squares: Squares, room: Array) -> float:
    """inf where no choice of ways can keep the limits, else -inf, because that is not known."""
    least = sum(
        np.min([square * way.low**2 for way, square in zip(f.ways, s, strict=True)], axis=0)
        for f, s in zip(squares.form.features, squares.squares, strict=True)
    )
    return np.inf if bool(np.any(np.asarray(least) > room * (1.0 + 1e-12))) else -np.inf


# Roots with a surplus of doubt under them: reweighted roots, proven at every step.
#
# A surplus N(v) of squares v lies above its tangent planes, so that a root with weighted squares,
# w = 1 + dN/dv at any reference point, lies below the requirement and is separable at prices
# (`is_separable`): its least cost, over all choices of ways, is a proven bound. At the weights of the
# optimum it is the optimum's cost. The weights of an allocation give the next allocation; every
# allocation is moved back within the limits, and the best counts.


DOUBT_STEPS = 40
"""Times the weights are renewed at most."""
GAP = 1e-10
"""Relative gap at which the weights are no longer renewed."""
NEAR, SETTLED = 1e-3, 1e-11
"""Relative change of the squares from which on allocations are moved back within the limits, and
the change that counts as none.
"""
RATIOS = -0.9, 0.5
"""Range of the ratio of a step to the one before that is used for extrapolation."""
CHORDS, DOUBT_CLOSE = 8, 1e-14
"""Points that are tried on the way to the limits, and the relative distance from a limit that
counts as met."""


def least_cost_under_doubt(form: Form, limits: Array, floor: float) -> Optimum:
    """The cheapest allocation that keeps each set of upper limits (n, r); `floor` bounds its cost.

    Cost and bound are inf where no allocation can keep them, the cost alone where none is known.
    """
    optimum = Optimum.unknown(form, limits, floor)
    reference: Array | None = None
    for row, limit in enumerate(limits):
        reweighted = _Reweighted(form, limit, reference)
        reweighted.run()
        reference = reweighted.reference
        optimum.bound[row] = max(floor, min(reweighted.bound, reweighted.cost))
        if reweighted.leaf is not None:
            optimum.chosen[row], optimum.t[row] = reweighted.leaf.ways, reweighted.t
            optimum.cost[row], optimum.multiplier[row] = reweighted.cost, reweighted.multiplier
    return optimum


class _Reweighted:
    """The best allocation and the best bound so far, at limits (r,).

    `reference` (r, features) are the squares at which the tangents touch.
    """

    def __init__(self, form: Form, limit: Array, reference: Array | None) -> None:
        self.form, self.limit, self.reference = form, limit, reference
        self.leaf: Leaf | None = None
        self.t, self.multiplier = np.empty(0), np.zeros(len(limit))
        self.cost, self.bound = np.inf, -np.inf

    def run(self) -> None:
        """Renew the weights until the gap closes or nothing changes."""
        known: Leaf | None = None
        step: Array | None = None
        for _ in range(DOUBT_STEPS):
            squares = self._squares()
            known, bound = least_leaf(squares, self.limit, known)
            self.bound = max(self.bound, bound)
            if not np.isfinite(known.cost):
                return
            squared_parts = Combination(self.form, known.ways).parts(known.t[None, :])[0] ** 2
            last, step = step, self._step(squared_parts)
            change = np.max(np.abs(step))
            if change <= NEAR:
                self._keep(known, squares)
                if self.cost - self.bound <= GAP * abs(self.cost) or change <= SETTLED:
                    return
            self.reference = self._drawn(squared_parts, step, last)
        if known is not None:
            self._keep(known, self._squares())

    def _squares(self) -> Squares:
        """The separable relaxation by the tangents at the reference."""
        weights = np.ones((len(self.limit), len(self.form.features)))
        constant = self.form.constant.copy()
        for row, surplus in enumerate(self.form.surpluses):
            if surplus is not None and self.reference is not None:
                at = self.reference[row]
                value, rise = surplus.value(at)
                weights[row] += rise
                constant[row] += max(float(value - rise @ at), 0.0)
        return Squares(self.form, weights, constant)

    def _step(self, squared_parts: Array) -> Array:
        """Logarithms of squares (r, features) over those of the reference."""
        if self.reference is None:
            return np.full_like(squared_parts, np.inf)
        real = (squared_parts > 0.0) & (self.reference > 0.0)
        ratio = np.divide(squared_parts, self.reference, out=np.ones_like(squared_parts), where=real)
        return np.asarray(np.log(ratio))

    def _drawn(self, squared_parts: Array, step: Array, last: Array | None) -> Array:
        """The next reference: the step times a factor by the ratio of the last two steps.

        Steps that overshoot are shortened, and slow ones lengthened (Aitken 1926).
        """
        if self.reference is None or last is None or not np.all(np.isfinite(last)):
            return squared_parts
        ratio = float(np.sum(step * last) / max(float(np.sum(last * last)), 1e-300))
        factor = 1.0 / (1.0 - float(np.clip(ratio, *RATIOS)))
        return np.asarray(np.where(self.reference > 0.0, self.reference, squared_parts) * np.exp(factor * step))

    def _keep(self, leaf: Leaf, squares: Squares) -> None:
        """Record an allocation, moved back within the limits, where it is the cheapest yet."""
        combination = Combination(self.form, leaf.ways)
        t = _move_within_limit(combination, leaf.t, self.limit)
        if t is None:
            return
        cost = float(combination.cost(t[None, :])[0])
        if cost < self.cost:
            self.leaf, self.t, self.cost = leaf, t, cost
            self.multiplier = leaf.mu * squares.worth(self.limit)


def _move_within_limit(combination: Combination, t: Array, limit: Array) -> Array | None:
    """Tolerances that keep the limits, nearly the first on the way from t to the tightest.

    Values are convex, so that they lie below their chord: where it meets a limit they keep it.
    """
    low, asked = combination.low, np.isfinite(limit)

    def excess(fraction: float) -> Array:
        values = combination.values((low + fraction * (t - low))[None, :])[0]
        return np.asarray((values - limit)[asked])

    outside, inside, fraction = excess(1.0), excess(0.0), 0.0
    if np.all(outside <= 0.0):
        return t
    if np.any(inside > 0.0):
        return None
    broken = outside > 0.0
    for _ in range(CHORDS):
        room = -inside[broken]
        tried = fraction + float(np.min(room / (room + outside[broken]))) * (1.0 - fraction)
        tried_excess = excess(tried)
        if np.any(tried_excess > 0.0):
            break
        fraction, inside = tried, tried_excess
        if np.max(tried_excess[broken] / limit[asked][broken]) >= -DOUBT_CLOSE:
            break
    return np.asarray(low + fraction * (t - low))
