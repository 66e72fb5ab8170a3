"""Several requirements, or correlated deviations: a convex programme for each set of limits.

Solved by SLSQP (Kraft 1988) in x_j = ln t_j with exact derivatives, and proven by its multipliers:
these give a lower bound whatever SLSQP did (`Combination.dual`), improved by L-BFGS-B (Byrd, Lu,
Nocedal & Zhu 1995) on the concave dual where a gap is left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, minimize

from .combination import Combination, Solved

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
        c, scale = self.combination, np.where(limit != 0.0, np.abs(limit), 1.0)
        movable = c.low < c.high

        def whole(x: Array) -> Array:
            t = c.low.copy()
            t[movable] = np.clip(np.exp(x), c.low[movable], c.high[movable])
            return t[None, :]

        if not np.any(movable):
            return c.low, np.zeros(len(limit))
        unit = float(c.cost(c.low[None, :])[0] - c.cost(c.high[None, :])[0]) or 1.0

        def margin(x: Array) -> Array:
            return np.asarray((limit - c.values(whole(x))[0]) / scale)

        def margin_slopes(x: Array) -> Array:
            t = whole(x)
            return np.asarray(-(c.gradients(t)[0] * t)[:, movable] / scale[:, None])

        def cost_slopes(x: Array) -> Array:
            t = whole(x)
            return np.asarray((c.slopes(t) * t)[0, movable] / unit)

        found = minimize(  # type: ignore[call-overload]
            lambda x: float(c.cost(whole(x))[0]) / unit,
            np.log(start[movable]),
            jac=cost_slopes,
            bounds=Bounds(np.log(c.low[movable]), np.log(c.high[movable])),
            constraints=[{"type": "ineq", "fun": margin, "jac": margin_slopes}],
            method="SLSQP",
            options={"ftol": 1e-15, "maxiter": 500},
        )
        price = np.maximum(np.asarray(found.multipliers), 0.0) * unit / scale
        return self._kept(whole(found.x)[0], limit), price

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
        result = minimize(  # type: ignore[call-overload]
            lambda y: -bound(y * unit) / abs(cost),
            multiplier / unit,
            bounds=Bounds(np.zeros(len(limit)), np.full(len(limit), np.inf)),
            method="L-BFGS-B",
        )
        better = np.asarray(result.x * unit)
        return max((found, multiplier), (bound(better), better), key=lambda pair: pair[0])
