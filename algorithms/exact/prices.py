"""Multipliers that make the requirements separable, and with them a lower bound of the cost.

For multipliers lambda_i >= 0, least cost under V_i(t) <= L_i is at least

    min_t  cost(t) + sum_i lambda_i (V_i(t) - L_i)

(weak duality; Boyd & Vandenberghe, Convex Optimization, 2004, ch. 5), and it stays a lower bound
where V_i is replaced by something smaller that is separable: S is at least its tangent at any
reference point (a root by Cauchy and Schwarz, a quantile because it is convex). A requirement that
is a root alone is priced by its square, constant + sum a_j^2 t_j^2 <= (L - offset)^2, which needs
no reference point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array, Flags, Integers
from ...problems.forms import Feature, Form, Way
from ...problems.spread import Spread, spread_of

ROUNDING = 1e-13
"""Relative allowance for rounding in a bound."""


def only_roots(form: Form) -> Flags:
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


def tabulated(form: Form, grid: Array, multiplier: Array, limits: Array, spread: Spread) -> tuple[list[Array], Array]:
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
        squared = only_roots(form) & (spread.value > 0.0)
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
