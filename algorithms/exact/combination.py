"""A combination of ways: the remaining problem is convex, and separable at given prices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...journal import stretch
from ...models.cost_reading import Joint
from ...models.roots import bracketed_roots
from ...problems.forms import Feature, Form, Spread, Way, spread_of
from ...section import Array, Flags, Integers
from .slsqp import ascend

# Multipliers that make the requirements separable, and with them a lower bound of the cost.
#
# For multipliers lambda_i >= 0, least cost under V_i(t) <= L_i is at least
#
#     min_t  cost(t) + sum_i lambda_i (V_i(t) - L_i)
#
# (weak duality; Boyd & Vandenberghe, Convex Optimization, 2004, ch. 5), and it stays a lower bound
# where V_i is replaced by something smaller that is separable: S is at least its tangent at any
# reference point (a root by Cauchy and Schwarz, a quantile because it is convex). A requirement that
# is a root alone is priced by its square, constant + sum a_j^2 t_j^2 <= (L - offset)^2, which needs
# no reference point.


ROUNDING = 1e-13
"""Relative allowance for rounding in a bound."""


def pure_root_rows(form: Form) -> Flags:
    """Which requirements (r,) are priced by their square: roots, no linear part or correlation."""
    ways = [way for feature in form.features for way in feature.ways]
    nothing = (0.0,) * len(form.outputs)
    linear = np.any(np.array([way.linear for way in ways]), axis=0)
    offset = np.any(np.array([way.offset or nothing for way in ways]), axis=0)
    spread = np.any(np.array([way.spread for way in ways]), axis=0) | (form.constant > 0.0)
    root = np.array([quantile is None for quantile in form.rows], dtype=bool)
    if form.surpluses:
        root &= np.array([surplus is None for surplus in form.surpluses])
    return np.asarray(root & ~linear & ~offset & spread & (form.correlation is None))


def spread_at(form: Form, chosen: Integers, t: Array, most: Array | None) -> Spread:
    """S at tolerances (n, features) of the chosen ways (n, features), and its tangents."""
    coefficients = [np.array([way.spread for way in f.ways])[chosen[:, at]] for at, f in enumerate(form.features)]
    return spread_of(form, t[:, None, :] * np.stack(coefficients, axis=2), most)


def rows_of(spread: Spread, rows: NDArray[Any]) -> Spread:
    """S and its tangents at some of the points."""
    return Spread(spread.value[rows], spread.direction[rows], spread.intercept[rows])


def tabulate_priced_costs(
    form: Form, grid: Array, multiplier: Array, limits: Array, spread: Spread
) -> tuple[list[Array], Array]:
    """Cost plus price of every way of each feature, (ways, g, n), and the sum (g, n) of the limits,
    at multiples `grid` (g,) of multipliers (n, r) and at limits (n, r), with tangents `spread`.
    """
    n, shape = len(limits), (len(grid), len(limits))
    rows = np.tile(np.arange(n), len(grid))
    prices = Prices.at(form, np.repeat(grid, n)[:, None] * multiplier[rows], limits[rows], rows_of(spread, rows))
    tables = [prices.ways(feature, at)[1].reshape(-1, *shape) for at, feature in enumerate(form.features)]
    return tables, prices.received.reshape(shape)


def less_rounding(total: Array, received: Array) -> Array:
    """`total` less `received`, and less an allowance for rounding, of the same shape."""
    return np.asarray(total - received - ROUNDING * (np.abs(total) + np.abs(received)))


@dataclass(frozen=True, slots=True, eq=False)
class Prices:
    """The prices of r requirements at n sets of limits.

    `linear` (n, r) is the price of V, `square` (n, r) that of its root's square, one of them zero;
    `direction` (n, r, features) is dS/ds at the reference point, `received` (n,) the sum of the
    limits at these prices.
    """

    linear: Array
    square: Array
    direction: Array
    received: Array

    @classmethod
    def at(cls, form: Form, multiplier: Array, limit: Array, spread: Spread) -> Prices:
        """Prices from multipliers and limits (n, r) and the S at n reference points."""
        safe = np.where(spread.value > 0.0, spread.value, 1.0)
        multiplier = np.where(np.isfinite(limit), multiplier, 0.0)
        squared = pure_root_rows(form) & (spread.value > 0.0)
        linear = np.where(squared, 0.0, multiplier)
        square = np.where(squared, multiplier / (2.0 * safe), 0.0)
        room = np.where(np.isfinite(limit), limit - form.offset, 0.0)
        with np.errstate(invalid="ignore"):
            received = np.where(linear > 0.0, linear * (room - spread.intercept), 0.0)
        received = received + square * (np.maximum(room, 0.0) ** 2 - form.constant)
        return cls(linear, square, spread.direction, received.sum(axis=1))

    def tolerance(self, way: Way, feature: int, count: float) -> tuple[Array, Array]:
        """The t (n,) at which a feature made in a `way` is cheapest, and cost plus price there."""
        m, a = np.array(way.linear), np.array(way.spread)
        linear = np.sum(self.linear * (m + self.direction[:, :, feature] * a), axis=1)
        square = self.square @ (a * a)
        t = (
            np.full_like(square, way.low)
            if way.low == way.high
            else way.curve.best(linear / count, square / count, way.low, way.high)
        )
        offset = self.linear @ np.array(way.offset) if way.offset else 0.0
        return t, count * way.curve.cost(t) + linear * t + square * t * t + offset

    def ways(self, feature: Feature, at: int) -> tuple[Array, Array]:
        """`tolerance` of every way of feature number `at`: t and cost plus price, (ways, n) each.

        Ways of one cost curve, with a stationary point in closed form, are solved at once.
        """
        count, ways = float(feature.count), feature.ways
        if len(ways) > 1 and all(way.curve == ways[0].curve for way in ways):
            solutions = self._of_one_curve(ways, at, count)
            if solutions is not None:
                return solutions
        pairs = [self.tolerance(way, at, count) for way in ways]
        return np.array([t for t, _ in pairs]), np.array([cost for _, cost in pairs])

    def _of_one_curve(self, ways: tuple[Way, ...], at: int, count: float) -> tuple[Array, Array] | None:
        curve, nothing = ways[0].curve, (0.0,) * self.linear.shape[1]
        m, a, offset = (
            np.array([getattr(way, name) or nothing for way in ways]) for name in ("linear", "spread", "offset")
        )
        low, high = (np.array([[getattr(way, name)] for way in ways]) for name in ("low", "high"))
        linear = m @ self.linear.T + a @ (self.linear * self.direction[:, :, at]).T
        square = (a * a) @ self.square.T
        stationary = curve.stationary(linear / count, square / count)
        if stationary is None:
            return None
        t = np.clip(stationary, low, high)
        return t, count * curve.cost(t) + linear * t + square * t * t + offset @ self.linear.T

    def bound(self, form: Form, total: Array) -> Array:
        """The proven bound (n,) from the sum (n,) over the features of what `tolerance` states."""
        slack = ROUNDING * (np.abs(total) + np.abs(self.received))
        return np.asarray(form.base + total - self.received - slack)


CHORDS = 8
"""Times that a step back within the limits is made longer, where rounding makes it too short."""
HARDLY = 1e-7
"""Fraction of a cost that a step out of the room of rounding may add: more where the tightest leave none."""


@dataclass(frozen=True, slots=True)
class Solved:
    """Least cost at n sets of r limits.

    Tolerances `t` (n, features), `cost` and proven lower `bound` (n,), `multiplier` (n, r): by how
    much the cost falls per unit of each limit. Cost and bound are inf where limits cannot be kept.
    """

    t: Array
    cost: Array
    bound: Array
    multiplier: Array


@dataclass(frozen=True, slots=True)
class Optimum:
    """Least cost at n sets of r limits: a `Solved` with the ways `chosen` (n, features)."""

    chosen: Integers
    t: Array
    cost: Array
    bound: Array
    multiplier: Array

    @classmethod
    def unknown(cls, form: Form, limits: Array, bound: float = np.inf) -> Optimum:
        """No allocation at any of the limits (n, r): infinite costs, and a bound for all of them."""
        shape = len(limits), len(form.features)
        bounds = np.full(shape[0], bound)
        nothing = np.zeros(shape, dtype=np.int64), np.full(shape, np.nan)
        return cls(*nothing, np.full(shape[0], np.inf), bounds, np.zeros_like(limits))

    def at(self, rows: NDArray[np.intp]) -> Optimum:
        """The optima at some of the limits."""
        return Optimum(self.chosen[rows], self.t[rows], self.cost[rows], self.bound[rows], self.multiplier[rows])


@dataclass(frozen=True, eq=False)
class Combination:
    """A `Form` with one way chosen per feature (`chosen`: index per feature).

    Tolerances have shape (n, features), values of the requirements (n, requirements).
    """

    form: Form
    chosen: tuple[int, ...]
    _last: tuple[tuple[bytes, object], Spread] | None = field(default=None, init=False, repr=False)

    @cached_property
    def ways(self) -> tuple[Way, ...]:
        """The chosen ways."""
        return tuple(f.ways[i] for f, i in zip(self.form.features, self.chosen, strict=True))

    @cached_property
    def counts(self) -> Array:
        """Like parts per feature."""
        return np.array([float(feature.count) for feature in self.form.features])

    @cached_property
    def low(self) -> Array:
        """Least tolerances (features,)."""
        return np.array([way.low for way in self.ways])

    @cached_property
    def high(self) -> Array:
        """Largest tolerances (features,)."""
        return np.array([way.high for way in self.ways])

    @cached_property
    def linear(self) -> Array:
        """m, shape (requirements, features)."""
        return _columns([way.linear for way in self.ways])

    @cached_property
    def spread(self) -> Array:
        """a, shape (requirements, features)."""
        return _columns([way.spread for way in self.ways])

    @cached_property
    def offset(self) -> Array:
        """Constant part of each value (requirements,)."""
        nothing = (0.0,) * len(self.form.outputs)
        offsets = _columns([way.offset or nothing for way in self.ways])
        return np.asarray(self.form.offset + offsets.sum(axis=1))

    @cached_property
    def _joint(self) -> Joint | None:
        return Joint.of([way.curve for way in self.ways])

    def cost(self, t: Array) -> Array:
        """Total cost (n,) of tolerances (n, features)."""
        if self._joint is not None:
            return np.asarray(self.form.base + self._joint.cost(t) @ self.counts)
        return np.asarray(self.form.base + np.sum(self.costs(t), axis=0))

    def costs(self, t: Array) -> Array:
        """What each feature costs (features, n) at tolerances (n, features)."""
        pairs = zip(self.ways, self.counts, strict=True)
        return np.array([count * way.curve.cost(t[:, at]) for at, (way, count) in enumerate(pairs)])

    def slopes(self, t: Array) -> Array:
        """d cost / d t, shape (n, features)."""
        way_slopes = [way.curve.slope(t[:, at]) for at, way in enumerate(self.ways)]
        return np.stack(way_slopes, axis=1) * self.counts

    def parts(self, t: Array) -> Array:
        """s = a t, shape (n, requirements, features)."""
        return np.asarray(t[:, None, :] * self.spread)

    def spread_at(self, t: Array) -> Spread:
        """S of each requirement at tolerances (n, features), and its tangents; the last are kept within a step.

        A search by gradients asks for values and slopes at one place; a resumed run begins with a step.
        """
        key = t.tobytes(), stretch()
        if self._last is None or self._last[0] != key:
            spread = spread_of(self.form, self.parts(t), np.abs(self.high * self.spread))
            object.__setattr__(self, "_last", (key, spread))
            return spread
        return self._last[1]

    def root(self, t: Array) -> Array:
        """S of each requirement (n, requirements)."""
        return self.spread_at(t).value

    def values(self, t: Array) -> Array:
        """The requirements' values (n, requirements), each to the last digit the same in whatever batch."""
        return np.asarray(self.offset + np.sum(t[:, None, :] * self.linear, axis=2) + self.root(t))

    @cached_property
    def tightest_values(self) -> Array:
        """The requirements' values (requirements,) at the least tolerances."""
        return np.asarray(self.values(self.low[None, :])[0])

    def sizes(self, limit: Array) -> Array:
        """Usual sizes (r,) of the requirements at limits (r,), by which what is small is measured."""
        least, most = np.abs(self.tightest_values), np.abs(self.values(self.high[None, :])[0])
        size = np.maximum(np.where(np.isfinite(limit), np.abs(limit), 0.0), 0.1 * np.minimum(least, most))
        return np.where(size > 0.0, size, np.where(most > 0.0, most, 1.0))

    def gradients(self, t: Array) -> Array:
        """d value / d t, shape (n, requirements, features)."""
        return np.asarray(self.linear + self.spread * self.spread_at(t).direction)

    def best(self, linear: Array, square: Array) -> Array:
        """Tolerances (n, features) of least cost + linear . t + square . t^2 at prices (n, f)."""
        if self._joint is not None:
            t = self._joint.stationary(linear / self.counts, square / self.counts)
            if t is not None:
                return np.clip(t, self.low, self.high)
        t = np.empty_like(linear)
        for at, (way, count) in enumerate(zip(self.ways, self.counts, strict=True)):
            way_prices = linear[:, at] / count, square[:, at] / count
            fixed = way.low == way.high
            t[:, at] = way.low if fixed else way.curve.best(*way_prices, way.low, way.high)
        return t

    def dual(self, multiplier: Array, limit: Array, t: Array) -> Array:
        """A proven lower bound (n,) of the cost at limits (n, r), for any multipliers (n, r) >= 0.

        `t` (n, features) is the reference point; at the optimum and its multipliers the bound is
        the optimum's cost.
        """
        prices = Prices.at(self.form, multiplier, limit, self.spread_at(t))
        ways = enumerate(zip(self.ways, self.counts, strict=True))
        total = np.sum([prices.tolerance(w, at, count)[1] for at, (w, count) in ways], axis=0)
        return prices.bound(self.form, total)


def within(form: Form, optimum: Optimum, limit: Array) -> Optimum:
    """The optima with tolerances moved within upper limits (r,), where their ways allow it.

    Optima at limits that are wider by the room of rounding use that room only where nothing else
    keeps the limits.
    """
    t, rows = optimum.t.copy(), np.flatnonzero(np.isfinite(optimum.cost))
    ways, alike = np.unique(optimum.chosen[rows], axis=0, return_inverse=True)
    for at, chosen in enumerate(ways):
        combination, same = Combination(form, tuple(chosen.tolist())), rows[alike.ravel() == at]
        moved = move_points_within_limits(combination, t[same], np.tile(limit, (len(same), 1)), combination.low)
        cost = optimum.cost[same]
        cheap = combination.cost(moved) - cost <= HARDLY * np.abs(cost)  # never where none is within them: NaN
        t[same[cheap]] = moved[cheap]
    return replace(optimum, t=t)


def move_point_within_limits(combination: Combination, t: Array, limit: Array, inner: Array) -> Array | None:
    """`move_points_within_limits` for one point (features,) and its limits (r,); None where it has none."""
    moved = move_points_within_limits(combination, t[None, :], limit[None, :], inner)[0]
    return None if np.any(np.isnan(moved)) else moved


def move_points_within_limits(combination: Combination, t: Array, limits: Array, inner: Array) -> Array:
    """Points (n, features) between those t and an `inner` one, as near to t as chords allow, within limits (n, r).

    Values are convex, so that they lie below the chord: where it meets a limit they keep it. What no
    value depends on stays where it is. NaN where the inner point does not keep the limits.
    """
    values = combination.values(np.vstack([t, inner]))
    inside = np.where(np.any((combination.spread != 0.0) | (combination.linear != 0.0), axis=0), inner, t)
    excess, room = np.maximum(values[:-1] - limits, 0.0), limits - values[-1]
    outside, moved = np.any(excess > 0.0, axis=1), t.copy()
    impossible = outside & np.any(room < 0.0, axis=1)
    moved[impossible] = np.nan
    rows = np.flatnonzero(outside & ~impossible)
    whole = excess[rows] + room[rows]
    shares = np.divide(excess[rows], whole, out=np.zeros_like(whole), where=excess[rows] > 0.0)
    fraction = shares.max(axis=1, initial=0.0)
    for _ in range(CHORDS):
        if not len(rows):
            return moved
        moved[rows] = t[rows] + fraction[:, None] * (inside[rows] - t[rows])
        broken = ~np.all(combination.values(moved[rows]) <= limits[rows], axis=1)
        rows, fraction = rows[broken], np.minimum(1.0, 2.0 * fraction[broken] + 1e-14)
    moved[rows] = inside[rows]
    return moved


def _columns(rows: Sequence[Sequence[float]]) -> Array:
    return np.array(rows, dtype=float).reshape(len(rows), -1).T


# The whole front of one requirement in one combination of ways, along the price nu.
#
# At the least cost under V(t) = offset + sum m_j t_j + S <= L, S = sqrt(constant + sum a_j^2 t_j^2),
# there is a multiplier lambda >= 0 with (Karush 1939, Kuhn & Tucker 1951)
#
#     -dC_j/dt_j = lambda (m_j + a_j^2 t_j / S)      inside of the range of t_j.
#
# With lambda = 2 nu S this is -dC_j/dt_j = 2 nu S m_j + 2 nu a_j^2 t_j: for m = 0 every t_j follows
# from nu alone, in closed form for the usual curves; for S = 0 nu stands for lambda itself; else S is
# the root of S - S(t(nu, S)), which rises with S. V falls as nu rises, so the nu of a limit is a root
# as well.


DECADES = 40.0
"""Prices are searched from 1e-40 to 1e40 of the units of cost and requirement."""
PATH_SAMPLES = 128
"""Prices that the arc length of a front is measured at."""


@dataclass(frozen=True, eq=False)
class Path:
    """The tolerances of least cost of a `Combination` with one requirement, by price."""

    combination: Combination

    @cached_property
    def ends(self) -> tuple[float, float]:
        """Logarithms of a price at which all is loosest, and one at which all is tightest."""
        x = np.linspace(-DECADES, DECADES, 81) * np.log(10.0)
        value = self.value(self.at(np.exp(x)))
        if not value[-1] < value[0]:  # nothing that costs anything moves it
            return float(x[0]), float(x[-1])
        loosest = np.flatnonzero(value >= value[0])[-1]
        tightest = np.flatnonzero(value <= value[-1])[0]
        return float(x[loosest]), float(x[max(tightest, loosest + 1)])

    @cached_property
    def tightest(self) -> Array:
        """The tolerances (features,) of least V; a feature that lowers it is at its widest."""
        return np.asarray(self.at(np.exp(np.array([self.ends[1]])))[0])

    @cached_property
    def cheapest(self) -> Array:
        """The tightest tolerances (features,) of least cost: some are tighter at no cost."""
        return np.asarray(self.at(np.exp(np.array([self.ends[0]])))[0])

    @cached_property
    def _rooted(self) -> bool:
        return bool(self.combination.root(self.combination.high[None, :])[0, 0] > 0.0)

    def value(self, t: Array) -> Array:
        """V (n,)."""
        return self.combination.values(t)[:, 0]

    def at(self, price: Array) -> Array:
        """Tolerances (n, features) at prices nu (n,)."""
        c, nu = self.combination, price[:, None]
        if not self._rooted:
            return c.best(nu * c.linear[0], np.zeros((len(nu), len(c.low))))
        squares = nu * c.spread[0] ** 2
        if not np.any(c.linear):
            return c.best(np.zeros_like(squares), squares)
        return c.best(2.0 * self._root(price)[:, None] * nu * c.linear[0], squares)

    def _root(self, price: Array) -> Array:
        """The S (n,) that equals the S of the tolerances of least cost at it."""
        c = self.combination
        low, high = (float(c.root(end[None, :])[0, 0]) for end in (c.low, c.high))

        def excess(root: Array, nu: Array) -> Array:
            nu, flat = nu.ravel()[:, None], root.ravel()[:, None]
            t = c.best(2.0 * flat * nu * c.linear[0], nu * c.spread[0] ** 2)
            return root - c.root(t)[:, 0].reshape(root.shape)

        roots = bracketed_roots(excess, (low * (1.0 - 1e-9), high * (1.0 + 1e-9)), price)
        return np.asarray(roots.x)

    # ---------------------------------------------------------------- at given limits

    def least_cost(self, limits: Array) -> Solved:
        """Least cost at upper limits (n, 1) of the requirement."""
        c, limit = self.combination, limits[:, 0]
        loosest, tightest = (float(self.value(t[None, :])[0]) for t in (c.high, self.tightest))
        least = float(c.cost(c.high[None, :])[0])
        inner = (limit < float(self.value(self.cheapest[None, :])[0])) & (limit >= tightest)
        t = np.where((limit >= loosest)[:, None], c.high, self.cheapest)
        bound, multiplier = np.full(len(limit), least), np.zeros_like(limits)
        if np.any(inner):
            t[inner], bound[inner], multiplier[inner] = self._inside(limits[inner])
        cost, bound = c.cost(t), np.maximum(bound, least)
        cost[limit < tightest], bound[limit < tightest] = np.inf, np.inf
        return Solved(t, cost, np.minimum(bound, cost), multiplier)

    def _inside(self, limits: Array) -> tuple[Array, Array, Array]:
        """Tolerances, bounds and multipliers at limits that bind."""
        limit = limits[:, 0]
        roots = bracketed_roots(self._excess, self.ends, limit)
        prices = tuple(np.exp(np.asarray(end)) for end in roots.bracket)
        outside, inside = (self.at(price) for price in prices)
        multipliers = [self._multiplier(price, t) for price, t in zip(prices, (outside, inside), strict=True)]
        bounds = [self.combination.dual(m, limits, t) for m, t in zip(multipliers, (outside, inside), strict=True)]
        met = self.value(outside) <= limit  # a root to the last digit
        multiplier = np.where(met[:, None], *multipliers)  # of the price at the limit, whichever point keeps it
        inside = np.where(met[:, None], outside, inside)
        inside = np.where((self.value(inside) <= limit)[:, None], inside, self.tightest)
        return self._between(inside, outside, limit), np.maximum(*bounds), multiplier

    def _excess(self, x: Array, upper: Array) -> Array:
        """V less a limit at logarithms of the price, any shape."""
        return self.value(self.at(np.exp(x.ravel()))).reshape(x.shape) - upper

    def _multiplier(self, price: Array, t: Array) -> Array:
        """lambda (n, 1) of a price nu (n,)."""
        return price[:, None] * (2.0 * self.combination.root(t) if self._rooted else 1.0)

    def _between(self, inside: Array, outside: Array, limit: Array) -> Array:
        """The cheapest point between two optima of one price: curves with kinks jump between them.

        V is convex, so that it crosses the limit once between them.
        """
        rows = np.flatnonzero(np.max(np.abs(outside / inside - 1.0), axis=1) > 1e-9)
        if not len(rows):
            return inside
        step = outside - inside

        def excess(fraction: Array, row: Array | NDArray[np.intp]) -> Array:
            at = row.astype(np.int64)
            return self.value(inside[at] + fraction[:, None] * step[at]) - limit[at]

        roots = bracketed_roots(excess, (0.0, 1.0), rows)
        fraction = np.where(excess(roots.x, rows) <= 0.0, roots.x, roots.bracket[0])
        between = inside.copy()
        between[rows] += fraction[:, None] * step[rows]
        better = self.combination.cost(between) < self.combination.cost(inside)
        return np.where(better[:, None], between, inside)

    # ---------------------------------------------------------------- the whole front

    def front(self, count: int, upper: float = np.inf, most: float = np.inf) -> Array:
        """`count` tolerances (count, features) along the front, evenly by its arc length.

        It begins where V keeps `upper` and ends where the cost keeps `most`.
        """
        x, value, cost = self.drawn(upper, most)
        length = arc_length(np.stack([value, cost]))
        even = np.linspace(0.0, length[-1], count)
        return self.at(np.exp(np.interp(even, length, x)))

    def drawn(self, upper: float = np.inf, most: float = np.inf) -> tuple[Array, Array, Array]:
        """Logarithms of prices along the front, in ascending order, with V and cost there, (PATH_SAMPLES,) each."""
        ends = self._begin(upper), self._end(most)
        x = np.linspace(ends[0], max(ends), PATH_SAMPLES)
        t = self.at(np.exp(x))
        return x, self.value(t), self.combination.cost(t)

    def keeps(self, upper: float) -> bool:
        """Whether any tolerances keep a limit of V."""
        return bool(self.value(self.tightest[None, :])[0] <= upper)

    def below(self, limits: Array, x: Array, value: Array, cost: Array) -> Array:
        """A cost (n,) below the least one at limits (n,) of V, by tangents at the nearest points that are `drawn`.

        Infinite at limits below all of them; beyond the loosest it is the least cost of all.
        """
        slope = -self._multiplier(np.exp(x), self.at(np.exp(x)))[:, 0]
        after = np.clip(len(value) - np.searchsorted(value[::-1], limits), 1, len(value) - 1)
        tangents = [cost[at] + slope[at] * (limits - value[at]) for at in (after - 1, after)]
        least = np.where(limits > value[0], cost[0], np.maximum(*tangents))
        return np.where(limits < value[-1], np.inf, least)

    def _begin(self, upper: float) -> float:
        """Logarithm of the least price at which V keeps a limit."""
        value = self.value(self.at(np.exp(np.array(self.ends))))
        if not value[1] < upper < value[0]:
            return self.ends[0]
        return float(bracketed_roots(self._excess, self.ends, upper).bracket[1])

    def _end(self, most: float) -> float:
        """Logarithm of the largest price at which the cost keeps a limit."""
        cost = self.combination.cost(self.at(np.exp(np.array(self.ends))))
        if not cost[0] <= most < cost[1]:
            return self.ends[1]

        def excess(x: Array) -> Array:
            t = self.at(np.exp(x.ravel()))
            return self.combination.cost(t).reshape(x.shape) - most

        roots = bracketed_roots(excess, self.ends)
        return float(roots.bracket[0])


def arc_length(drawn: Array) -> Array:
    """Arc length (n,) along points (2, n), each axis in units of its span."""
    finite = np.where(np.isfinite(drawn), drawn, np.nan)
    span = np.nanmax(finite, axis=1) - np.nanmin(finite, axis=1)
    steps = np.nan_to_num(np.diff(finite, axis=1)) / np.where(span > 0.0, span, 1.0)[:, None]
    return np.concatenate([[0.0], np.cumsum(np.hypot(*steps))])


# The best multipliers of a form with open alternatives: the maximum of its Lagrangian dual.
#
# The dual is concave in the multipliers, with any alternatives open. A single factor for all of them,
# as the search of `choices` tries, causes a gap of percents where many requirements bind; the maximum
# by L-BFGS-B (Byrd, Lu, Nocedal & Zhu 1995) has only the duality gap.


MIN_PRICED_FRACTION = 1e-6
"""Fraction of the bound that a limit is worth at least, where prices are improved from."""
STEPS = 200
"""Evaluations of the dual at most."""


@dataclass(frozen=True, eq=False)
class Ascent:
    """The dual of a form at one set of limits (r,), with tangents at one reference point."""

    form: Form
    limit: Array
    spread: Spread

    def multipliers(self, first: Array) -> Array:
        """Multipliers (r,) of the largest bound, begun from `first`."""
        asked = np.isfinite(self.limit)
        scale = abs(self.value(first)[0]) or 1.0
        sizes = np.where(asked & (self.limit != 0.0), np.abs(np.where(asked, self.limit, 1.0)), 1.0)
        worth = max(float(np.max(first * sizes, initial=0.0)), MIN_PRICED_FRACTION * scale)
        unit = np.where(first > 0.0, first, 1e-2 * worth / sizes)

        def scaled(y: Array) -> tuple[float, Array]:
            value, slope = self.value(y * unit)
            return value / scale, slope * unit / scale

        start, high = np.where(asked, first / unit, 0.0), np.where(asked, np.inf, 0.0)
        better = ascend(scaled, start, high, slopes=True, maxfun=STEPS) * unit
        return better if self.value(better)[0] >= self.value(first)[0] else first

    def value(self, multiplier: Array) -> tuple[float, Array]:
        """The proven bound, and its slope (r,) by the multipliers."""
        form = self.form
        prices = Prices.at(form, multiplier[None, :], self.limit[None, :], self.spread)
        direction, total = prices.direction[0], 0.0
        linear, square = form.offset.copy(), form.constant.copy()
        for at, feature in enumerate(form.features):
            tolerances, costs = prices.ways(feature, at)
            best = int(np.argmin(costs[:, 0]))
            way, t = feature.ways[best], float(tolerances[best, 0])
            total += float(costs[best, 0])
            m, a = np.array(way.linear), np.array(way.spread)
            linear += (m + direction[:, at] * a) * t + (np.array(way.offset) if way.offset else 0.0)
            square += (a * t) ** 2
        bound = float(prices.bound(form, np.array([total]))[0])
        return bound, self._slope(linear, square)

    def _slope(self, linear: Array, square: Array) -> Array:
        """The excess of every requirement over its limit, of the value or the square that has the price."""
        form, asked = self.form, np.isfinite(self.limit)
        value = self.spread.value[0]
        limit = np.where(asked, self.limit, 0.0)
        room = np.maximum(limit - form.offset, 0.0)
        squared = pure_root_rows(form) & (value > 0.0)
        by_square = (square - room**2) / (2.0 * np.where(value > 0.0, value, 1.0))
        along = linear + self.spread.intercept[0] - limit
        return np.where(asked, np.where(squared, by_square, along), 0.0)
