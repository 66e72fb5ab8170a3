"""Several requirements, or correlated deviations: a convex programme for each set of limits.

Solved by SLSQP (Kraft 1988) in x_j = ln t_j with exact derivatives, and proven by its multipliers:
these give a lower bound whatever SLSQP did (`Combination.dual`), improved by L-BFGS-B (Byrd, Lu,
Nocedal & Zhu 1995) on the concave dual where a gap is left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .combination import Combination, Solved
from .slsqp import ascend, slsqp

Array = NDArray[np.float64]
GAP = 1e-10
"""Relative gap from which on the multipliers are improved."""


@dataclass(frozen=True, eq=False)
class Programme:
    """The tolerances of least cost of a `Combination` with any number of requirements."""

    combination: Combination

    def least_cost(self, limits: Array) -> Solved:
        """Least cost at sets of upper limits (n, r)."""
        c, n = self.combination, len(limits)
        t, cost = np.tile(c.low, (n, 1)), np.full(n, np.inf)
        bound, multiplier = np.full(n, np.inf), np.zeros_like(limits)
        start = c.high
        for row in np.flatnonzero(np.all(c.values(t) <= limits, axis=1)):
            start, multiplier[row] = self._solved(limits[row], start)
            t[row] = start
            cost[row] = c.cost(start[None, :])[0]
            bound[row], multiplier[row] = self._proven(limits[row], start, multiplier[row])
        return Solved(t, cost, np.minimum(bound, cost), multiplier)

    def _solved(self, limit: Array, start: Array) -> tuple[Array, Array]:
        """Tolerances (features,) that keep the limits, and multipliers (r,)."""
        c, movable = self.combination, self.combination.low < self.combination.high
        if not np.any(movable):
            return c.low, np.zeros(len(limit))
        scale = np.where(limit != 0.0, np.abs(limit), 1.0)
        unit = float(c.cost(c.low[None, :])[0] - c.cost(c.high[None, :])[0]) or 1.0

        def whole(x: Array) -> Array:
            t = c.low.copy()
            t[movable] = np.clip(np.exp(x), c.low[movable], c.high[movable])
            return t[None, :]

        def slopes(x: Array) -> Array:
            t = whole(x)
            return np.asarray((c.slopes(t) * t)[0, movable] / unit)

        def margin_slopes(x: Array) -> Array:
            t = whole(x)
            return np.asarray(-(c.gradients(t)[0] * t)[:, movable] / scale[:, None])

        found = slsqp(
            lambda x: float(c.cost(whole(x))[0]) / unit,
            slopes,
            lambda x: (limit - c.values(whole(x))[0]) / scale,
            margin_slopes,
            np.log(start[movable]),
            (np.log(c.low[movable]), np.log(c.high[movable])),
            1e-15,
            500,
        )
        return self._kept(whole(found.x)[0], limit), found.multiplier * unit / scale

    def _kept(self, t: Array, limit: Array) -> Array:
        """The point nearest to t on the way from the tightest corner that keeps the limits."""
        c, low, high = self.combination, 0.0, 1.0
        if np.all(c.values(t[None, :])[0] <= limit):
            return t
        for _ in range(60):
            middle = 0.5 * (low + high)
            point = c.low + middle * (t - c.low)
            kept = bool(np.all(c.values(point[None, :])[0] <= limit))
            low, high = (middle, high) if kept else (low, middle)
        return np.asarray(c.low + low * (t - c.low))

    def _proven(self, limit: Array, t: Array, multiplier: Array) -> tuple[float, Array]:
        """The best bound found, and its multipliers (r,)."""
        c, cost = self.combination, float(self.combination.cost(t[None, :])[0])

        def bound(price: Array) -> float:
            return float(c.dual(price[None, :], limit[None, :], t[None, :])[0])

        found = bound(multiplier)
        if cost - found <= GAP * abs(cost):
            return found, multiplier
        unit = np.where(multiplier > 0.0, multiplier, max(float(multiplier.max()), 1e-9) * 1e-3)
        better = unit * ascend(lambda y: bound(y * unit) / abs(cost), multiplier / unit)
        return max((found, multiplier), (bound(better), better), key=lambda pair: pair[0])
