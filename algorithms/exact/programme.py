"""Several requirements, or correlated deviations: a convex programme for each set of limits.

It is solved by SLSQP (Kraft 1988) in x_j = ln t_j with exact derivatives, and proven by its
multipliers: these give a lower bound at any result of SLSQP (`Combination.dual`), improved by L-BFGS-B
(Byrd, Lu, Nocedal & Zhu 1995) on the concave dual where a gap remains. Where deviations compensate
each other the tightest tolerances are not those of least variation: limits that they break are kept
by the allocation that breaks them least, or by none where its tangents prove that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from ...journal import recall_arrays
from ...section import Array, Flags
from .combination import (
    ROUNDING,
    Combination,
    Solved,
    move_point_within_limits,
    move_points_within_limits,
    pure_root_rows,
)
from .slsqp import ascend, slsqp

GAP, GAP_QUANTILE = 1e-10, 1e-8
"""Relative gap from which on the multipliers are improved; that of quantiles, which take longer."""
TOLERANCE, TOLERANCE_QUANTILE = 1e-15, 1e-10
"""Tolerance of SLSQP."""
QUICK, NEAR = 1e-9, 1e-5
"""The same where nothing is proven, and the fraction of a limit by which it may then be broken."""
FLAT, BENDS = 1e-2, 2.0
"""Fraction of the largest fall of a cost that every fall counts with at least, and the curvature
of a Lagrangian in units of the fall."""
BETWEEN = 17
"""Points between the tightest and the loosest tolerances that a search without a start evaluates."""
MIN_PRICED_FRACTION = 1e-6
"""Fraction of the cost that a limit is worth at least, where prices are improved from."""
MIN_ROW_SCALE = 1e-6
"""Fraction of a limit that counts as a step where nothing moves its value."""
CORNER = 1e-5
"""Fraction of a limit up to which the tightest tolerances leave so little room that SLSQP, whose steps
leave it at once, may stop anywhere: there the corner itself is a start and a candidate."""
CLEARLY = 1e-9
"""Fraction of a limit by which it must be broken before it counts as impossible to keep."""
TRIED = 33
"""Points that are tried between the tightest tolerances and those that compensate them."""
MAX_PRICED_ROWS = 12
"""Requirements up to which prices are solved for: a step of Newton's method takes an evaluation for each."""
NEWTON_STEPS, NEWTON_MISS = 40, 4e-15
"""Steps of Newton's method in the logarithms of prices at most, and the logarithm by which a limit may be missed."""
NUDGE, LONGEST_STEP, WORTHLESS = 1e-6, 2.0, 60.0
"""A change of a logarithm for derivatives, its longest step, and its fall from which on a limit has no price."""


@dataclass(frozen=True, eq=False)
class Programme:
    """The tolerances of least cost of a `Combination` with any number of requirements."""

    combination: Combination

    def least_cost(self, limits: Array, starts: Array | None = None) -> Solved:
        """Least cost at sets of upper limits (n, r), begun from `starts` (n, features) if known.

        Where no allocation that keeps the limits is known, nor proven not to exist, the cost is inf
        and the bound that without limits. A start of NaN is unknown.
        """
        c, n = self.combination, len(limits)
        t, cost = np.tile(c.high, (n, 1)), np.full(n, np.inf)
        bound, multiplier = np.full(n, float(c.cost(c.high[None, :])[0])), np.zeros_like(limits)
        priced = self._solved_by_prices(limits)
        enough = np.full(n, False) if priced is None else priced.cost <= priced.bound + GAP * np.abs(priced.bound)
        start: Array | None = None
        for row, limit in enumerate(limits):
            if priced is not None and enough[row]:
                t[row], multiplier[row] = priced.t[row], priced.multiplier[row]
                bound[row] = max(bound[row], priced.bound[row])
            elif not self._keeps(c.high, limit):
                inner, possible = self._inner(limit)
                if inner is None:
                    bound[row] = bound[row] if possible else np.inf
                    continue
                tolerance = TOLERANCE_QUANTILE if c.form.quantiles else TOLERANCE
                if starts is not None and not np.any(np.isnan(starts[row])):
                    start = np.clip(starts[row], c.low, c.high)
                first = self._between(limit, inner) if start is None else start
                solve = partial(self._solved, limit, first, inner, tolerance)
                start, multiplier[row] = recall_arrays((limit, first, inner), solve)
                corner = self._cornered(limit)
                if corner is not None:
                    further, prices = self._solved(limit, corner, inner, tolerance)
                    costs = [float(c.cost(point[None, :])[0]) for point in (corner, start, further)]
                    multiplier[row] = multiplier[row] if costs[1] < costs[2] else prices
                    start = (corner, start, further)[int(np.argmin(costs))]
                t[row] = start
                proven, multiplier[row] = self._proven(limit, start, multiplier[row])
                bound[row] = max(bound[row], proven)
            cost[row] = c.cost(t[row][None, :])[0]
        return Solved(t, cost, np.minimum(bound, cost), multiplier)

    def _solved_by_prices(self, limits: Array) -> Solved | None:
        """Least cost at sets of limits (n, r) at once, where every requirement is separable; else None.

        Sums of squares under a root and plain sums are met by Newton's method in the logarithms of their prices, at
        which each tolerance follows alone. Limits are added one at a time, the one that is broken most, as in the
        dual method of Goldfarb & Idnani (1983); cost and bound are infinitely apart where that does not end.
        """
        c, (n, r) = self.combination, limits.shape
        squared, pairs = self._prices, np.arange(len(limits))
        if squared is None or not 0 < r <= MAX_PRICED_ROWS:
            return None
        square, linear = np.where(squared[:, None], c.spread**2, 0.0), np.where(squared[:, None], 0.0, c.linear)
        room = limits - c.offset
        goal = np.where(squared, np.maximum(room, 0.0) ** 2 - c.form.constant, room)
        asked = np.isfinite(limits)
        possible = np.all(c.tightest_values <= limits, axis=1) & np.all(goal > 0.0, axis=1)
        goal = np.log(np.where(asked & possible[:, None], goal, np.inf))
        middle = np.sqrt(c.low * c.high)
        fall = np.maximum(-c.slopes(middle[None, :])[0] * middle, 0.0).sum()
        first = np.log(max(fall, np.finfo(float).tiny) / (middle**2 @ square.T + middle @ linear.T))

        def at(y: Array) -> tuple[Array, Array]:
            price = np.exp(y)
            t = c.best(price @ linear, price @ square)
            return t, np.log(t**2 @ square.T + t @ linear.T) - goal

        y = np.full((n, r), -np.inf)
        t, excess = at(y)
        for _ in range(2 * r):
            active = np.isfinite(y)
            worst = np.argmax(np.where(active, -np.inf, excess), axis=1)
            grown = ~active[pairs, worst] & (excess[pairs, worst] > 0.0)
            if not np.any(grown):
                break
            y[pairs[grown], worst[grown]] = first[worst[grown]]
            y, t, excess = _met_limits(at, y, first)
        return self._within_by_prices(limits, t, np.exp(y) * np.where(squared, 2.0 * c.root(t), 1.0))

    def _within_by_prices(self, limits: Array, t: Array, multiplier: Array) -> Solved:
        """Tolerances (n, features) moved within limits (n, r) by chords to the tightest, and what is proven."""
        c = self.combination
        moved = move_points_within_limits(c, t, limits, c.low)
        kept = np.all(np.isfinite(moved), axis=1) & np.all(np.isfinite(multiplier), axis=1)
        bound = np.zeros(len(limits))
        bound[kept] = c.dual(multiplier[kept], limits[kept], moved[kept])
        return Solved(moved, np.where(kept, c.cost(moved), np.inf), bound, multiplier)

    @cached_property
    def _prices(self) -> Flags | None:
        """Which requirements (r,) are priced by their square, the others by themselves; None where some
        is neither a root of squares nor a sum, or where prices may make tolerances jump.
        """
        c = self.combination
        squared = pure_root_rows(c.form)
        plain = ~np.any(c.spread, axis=1) & (c.form.constant == 0.0) & np.all(c.linear >= 0.0, axis=1)
        moved = np.any(c.spread, axis=1) | np.any(c.linear, axis=1)
        alone = c.form.correlation is None and not c.form.quantiles
        smooth = np.all(c.low > 0.0) and all(way.curve.smooth for way in c.ways)
        return squared if alone and smooth and np.all((squared | plain) & moved) else None

    def _cornered(self, limit: Array) -> Array | None:
        """Tolerances (features,) where hardly more than the tightest keep a limit, None where they do not.

        What contributes to such a limit stays at its tightest, but for what can all be loosest within
        the room; the rest is solved for the other limits.
        """
        c = self.combination
        tight = np.isfinite(limit) & (np.abs(limit - c.tightest_values) <= CORNER * np.abs(limit))
        if not np.any(tight):
            return None
        values = c.values(np.vstack([c.low, np.where(np.eye(len(c.low), dtype=bool), c.high, c.low)]))
        room = np.maximum(limit - c.tightest_values, 0.0)[tight] / len(c.low)
        pinned = np.any((values[1:] - values[0])[:, tight] > room, axis=1)
        ways = [replace(way, high=way.low) if fixed else way for way, fixed in zip(c.ways, pinned, strict=True)]
        features = tuple(replace(f, ways=(way,)) for f, way in zip(c.form.features, ways, strict=True))
        rest = Programme(Combination(replace(c.form, features=features), (0,) * len(features)))
        t = rest.least_cost(np.where(tight, np.inf, limit)[None, :]).t[0]
        return t if self._keeps(t, limit) else None

    def allocation(self, limit: Array, start: Array | None = None) -> Array | None:
        """Tolerances (features,) of least cost near limits (r,), from a `start`; nothing is proven.

        None where SLSQP ends beyond the limits by more than `NEAR`.
        """
        c = self.combination
        if self._keeps(c.high, limit):
            return c.high
        near = limit + NEAR * c.sizes(limit)
        if self._compensating and np.any(c.tightest_values > near):
            traded = self._traded(near)
            if traded is not None and traded[0] is None:  # SLSQP would search long in vain
                return None
        first = self._between(limit, c.low) if start is None else np.clip(start, c.low, c.high)
        t = self._solved(limit, first, None, QUICK)[0]
        return t if self._keeps(t, near) else None

    def kept_allocation(self, limit: Array, start: Array) -> Array | None:
        """Tolerances (features,) of nearly least cost that keep limits (r,), from a `start`."""
        c = self.combination
        if self._keeps(c.high, limit):
            return c.high
        inner, _ = self._inner(limit)
        first = np.clip(start, c.low, c.high)
        return None if inner is None else self._solved(limit, first, inner, QUICK)[0]

    def _between(self, limit: Array, inner: Array) -> Array:
        """The loosest tolerances (features,) between `inner` and the loosest that keep limits.

        Where even `inner` breaks them it is that.
        """
        c = self.combination
        fraction = np.linspace(0.0, 1.0, BETWEEN)[:, None]
        tried = np.exp((1.0 - fraction) * np.log(inner) + fraction * np.log(c.high))
        kept = np.flatnonzero(np.all(c.values(tried) <= limit, axis=1))
        return np.asarray(np.clip(tried[kept[-1] if len(kept) else 0], c.low, c.high))

    def _keeps(self, t: Array, limit: Array) -> bool:
        return bool(np.all(self.combination.values(t[None, :])[0] <= limit))

    def _inner(self, limit: Array) -> tuple[Array | None, bool]:
        """Tolerances (features,) that keep the limits, None where none are known; whether any may.

        Every value is above its tangent at t: where a mean of the tangents of the limits, by the
        multipliers, stays above 0 in the whole range, no tolerances keep them all.
        """
        c = self.combination
        if np.all(c.tightest_values <= limit):
            return c.low, True
        if not self._compensating:
            return None, False
        traded = self._traded(limit)
        if traded is not None:
            return traded
        tight = np.where(np.any(c.linear < 0.0, axis=0), np.linspace(0.0, 1.0, TRIED)[:, None], 0.0)
        tried = c.low + tight * (c.high - c.low)
        kept = np.flatnonzero(np.all(c.values(tried) <= limit, axis=1))
        if len(kept):
            return tried[kept[len(kept) // 2]], True
        t, weight = self.least_excess(limit)
        if self._keeps(t, limit):
            return t, True
        asked = np.isfinite(limit)
        spread = c.spread_at(t[None, :])
        slopes = weight[asked] @ (c.linear + c.spread * spread.direction[0])[asked]
        constant = (c.offset + spread.intercept[0] - limit)[asked]
        ends = np.minimum(slopes * c.low, slopes * c.high)
        least = weight[asked] @ constant + np.sum(ends)
        slack = ROUNDING * (weight[asked] @ np.abs(constant) + np.sum(np.abs(ends)))
        return None, not least > slack

    def _traded(self, limit: Array) -> tuple[Array | None, bool] | None:
        """As `_inner`, with all features at their tightest but one without spread that lowers a value.

        Values rise with the spread of all others, whose means fall by no more than over their whole
        range. None where several features lower values, where deviations are correlated, or where
        the bounds do not decide.
        """
        c = self.combination
        falls, spreads = np.any(c.linear < 0.0, axis=0), np.any(c.spread != 0.0, axis=0)
        free = np.flatnonzero(falls & ~spreads)
        if c.form.correlation is not None or len(free) != 1:
            return None
        at, width = int(free[0]), c.high - c.low
        room, slope = limit - c.tightest_values, c.linear[:, at]
        least, most = _reach(room, slope, float(width[at]))
        t = c.low.copy()
        t[at] = np.clip(t[at] + 0.5 * (least + most), c.low[at], c.high[at])
        if self._keeps(t, limit):
            return t, True
        gained = -np.minimum(c.linear, 0.0)[:, falls & spreads] @ width[falls & spreads]
        room = room + gained + CLEARLY * c.sizes(limit)
        least, most = _reach(room, slope, float(width[at]))
        return (None, False) if least > most or np.any(room[slope == 0.0] < 0.0) else None

    @property
    def _compensating(self) -> bool:
        """Whether a value may fall with a tolerance."""
        correlation, c = self.combination.form.correlation, self.combination
        falls = correlation is not None and np.any(correlation < 0.0)
        return bool(falls or np.any(c.linear < 0.0))

    def least_excess(self, limit: Array) -> tuple[Array, Array]:
        """Tolerances (features,) of the least largest excess over the limits; weights (r,)."""
        c, r = self.combination, len(limit)
        width, asked = c.high - c.low, np.isfinite(limit)
        scale = np.where(asked, c.sizes(limit), 1.0)

        def whole(y: Array) -> Array:
            return np.asarray(c.low + width * np.clip(y[:-1], 0.0, 1.0))[None, :]

        def margins(y: Array) -> Array:
            return np.asarray((y[-1] - (c.values(whole(y))[0] - limit) / scale)[asked])

        def margin_slopes(y: Array) -> Array:
            value_slopes = -(c.gradients(whole(y))[0] * width)[asked] / scale[asked, None]
            return np.hstack([value_slopes, np.ones((len(value_slopes), 1))])

        first = np.append(np.full(len(width), 0.5), 0.0)
        first[-1] = float(np.max(-margins(first)))
        away = np.append(np.zeros(len(width)), -1e3), np.append(np.ones(len(width)), 1e3)
        only = np.append(np.zeros(len(width)), 1.0)
        solution = slsqp(lambda y: float(y[-1]), lambda y: only, margins, margin_slopes, first, away, 1e-15, 500)
        weight = np.zeros(r)
        weight[asked] = solution.multiplier / scale[asked]
        return whole(solution.x)[0], weight

    def _solved(self, limit: Array, start: Array, inner: Array | None, tolerance: float) -> tuple[Array, Array]:
        """Tolerances (features,) that keep the limits, and multipliers (r,).

        Without an `inner` point they keep them as well as SLSQP does.
        """
        c, movable = self.combination, self.combination.low < self.combination.high
        if not np.any(movable):
            return c.low, np.zeros(len(limit))
        asked = np.isfinite(limit)
        step, unit = self._steps(start, movable)
        rise = (c.gradients(start[None, :])[0] * start)[asked][:, movable] * step
        scale = np.maximum(np.linalg.norm(rise, axis=1), MIN_ROW_SCALE * np.abs(limit[asked]))
        scale = np.where(scale > 0.0, scale, 1.0)

        def whole(x: Array) -> Array:
            t = c.low.copy()
            t[movable] = np.clip(np.exp(x * step), c.low[movable], c.high[movable])
            return t[None, :]

        def slopes(x: Array) -> Array:
            t = whole(x)
            return np.asarray((c.slopes(t) * t)[0, movable] * step / unit)

        def margin_slopes(x: Array) -> Array:
            t = whole(x)
            return np.asarray(-(c.gradients(t)[0] * t)[asked][:, movable] * step / scale[:, None])

        solution = slsqp(
            lambda x: float(c.cost(whole(x))[0]) / unit,
            slopes,
            lambda x: (limit - c.values(whole(x))[0])[asked] / scale,
            margin_slopes,
            np.log(start[movable]) / step,
            (np.log(c.low[movable]) / step, np.log(c.high[movable]) / step),
            tolerance,
            500,
        )
        multiplier = np.zeros(len(limit))
        multiplier[asked] = solution.multiplier * unit / scale
        t = whole(solution.x)[0]
        if inner is not None:
            moved = move_point_within_limits(c, t, limit, inner)
            t = inner if moved is None else moved
        return t, multiplier

    def _steps(self, start: Array, movable: Flags) -> tuple[Array, float]:
        """Units of ln t (movable,) and of the cost in which the Lagrangian bends by one all round.

        For C = b/t^k its second derivative in ln t is k C in addition to that of the priced
        requirement, which is about as much as C falls.
        """
        fall = np.maximum(-(self.combination.slopes(start[None, :])[0] * start)[movable], 0.0)
        largest = float(fall.max()) or 1.0
        return np.sqrt(largest / np.maximum(fall, FLAT * largest)), BENDS * largest

    def _proven(self, limit: Array, t: Array, multiplier: Array) -> tuple[float, Array]:
        """The best known bound, and its multipliers (r,)."""
        c, cost = self.combination, float(self.combination.cost(t[None, :])[0])

        def bound(price: Array) -> float:
            return float(c.dual(price[None, :], limit[None, :], t[None, :])[0])

        first_bound = bound(multiplier)
        enough = GAP_QUANTILE if c.form.quantiles else GAP
        if cost - first_bound <= enough * abs(cost):
            return first_bound, multiplier
        sizes = c.sizes(limit)
        worth = max(float(np.max(multiplier * sizes)), MIN_PRICED_FRACTION * abs(cost))
        unit = np.where(multiplier > 0.0, multiplier, 1e-3 * (worth or 1.0) / sizes)
        better = unit * ascend(lambda y: bound(y * unit) / (abs(cost) or 1.0), multiplier / unit)
        return max((first_bound, multiplier), (bound(better), better), key=lambda pair: pair[0])


def _met_limits(at: Callable[[Array], tuple[Array, Array]], y: Array, first: Array) -> tuple[Array, Array, Array]:
    """Logarithms of prices (n, r) at which the limits that have one are met, tolerances and excesses there.

    By Newton's method from y on, -inf where there is no price; `at` gives tolerances (n, features) and logarithms of
    what they use of the limits (n, r), `first` (r,) are usual prices, by which one counts as none.
    """
    t, excess = at(y)
    for _ in range(NEWTON_STEPS):
        active = np.isfinite(y)
        miss = np.where(active, excess, 0.0)
        if np.all(np.abs(miss) <= NEWTON_MISS):
            break
        each = np.eye(y.shape[1])
        with np.errstate(invalid="ignore"):  # of a limit that is not asked
            slopes = np.stack([at(y + NUDGE * one)[1] - excess for one in each], axis=2) / NUDGE
        slopes = np.where(active[:, :, None] & active[:, None, :], slopes, 0.0)
        slopes = slopes - each * np.where(active, NUDGE, 1.0)[:, :, None]
        y = y - np.clip(np.linalg.solve(slopes, miss[..., None])[..., 0], -LONGEST_STEP, LONGEST_STEP)
        y = np.where(y < first - WORTHLESS, -np.inf, y)
        t, excess = at(y)
    return y, t, excess


def _reach(room: Array, slope: Array, width: float) -> tuple[float, float]:
    """The least necessary and the largest allowed step of a feature, from 0 to `width`, for values
    with slopes (r,) and room (r,).
    """
    moved = np.divide(room, slope, out=np.zeros_like(room), where=slope != 0.0)
    least = float(np.max(moved, where=slope < 0.0, initial=0.0))
    return least, float(np.min(moved, where=slope > 0.0, initial=width))
