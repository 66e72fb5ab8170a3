"""Costs of good parts as cost curves: by the limit of inspection, and by their scatter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.optimize.elementwise import find_root

from ..costs import CostCurve, Table
from .machine import Machine

Array = NDArray[np.float64]
KNOTS = 2049
"""Limits at which scatter and cost are tabulated for their inverses."""
STEPS = 3
"""Steps of Newton's method from the tabulated inverse, which is right to six digits."""
FINE = 16
"""Points per interval of a hull at which it is tried to lie below the cost."""


@dataclass(frozen=True)
class GoodPartsByLimit(CostCurve):
    """Cost of a good part of an inspected `machine` against the limits +-t."""

    machine: Machine

    def cost(self, t: Array) -> Array:
        return self.machine.good_parts(t).cost

    def slope(self, t: Array) -> Array:
        return self.machine.good_parts(t).cost_slope


@dataclass(frozen=True)
class GoodPartsBySpread(CostCurve):
    """The same against x = `scale` times the standard deviation of good parts.

    Limits run from `low` to `high`. The scatter rises with the limit, so that x stands for it.
    """

    machine: Machine
    low: float
    high: float
    scale: float

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        """Limits and x there."""
        t = np.linspace(self.low, self.high, KNOTS)
        return t, self.scale * self.machine.good_parts(t).std

    @property
    def ends(self) -> tuple[float, float]:
        """Least and largest x."""
        x = self._table[1]
        return float(x[0]), float(x[-1])

    @cached_property
    def _inverse(self) -> PchipInterpolator:
        t, x = self._table
        rising = np.concatenate([[True], np.diff(np.maximum.accumulate(x)) > 0.0])
        return PchipInterpolator(x[rising], t[rising])

    def limit(self, x: Array) -> Array:
        """The limit t of an inspection that leaves good parts with the scatter x."""
        t = np.clip(self._inverse(np.clip(x, *self.ends)), self.low, self.high)
        for _ in range(STEPS):
            found = self.machine.good_parts(t)
            rise = self.scale * found.std_slope
            step = (x - self.scale * found.std) / np.where(rise > 0.0, rise, np.inf)
            t = np.clip(t + step, self.low, self.high)
        return np.asarray(t)

    def cost(self, t: Array) -> Array:
        return self.machine.good_parts(self.limit(np.asarray(t, dtype=float))).cost

    def slope(self, t: Array) -> Array:
        found = self.machine.good_parts(self.limit(np.asarray(t, dtype=float)))
        return np.asarray(found.cost_slope / (self.scale * found.std_slope))

    def best(self, linear: Array, square: Array, low: float, high: float) -> Array:
        if not np.any(linear):
            return np.clip(self._by_square(square), low, high)
        ends = self.limit(np.array([low, high]))
        return np.clip(self._by_both(linear, square, *ends), low, high)

    @cached_property
    def _worth(self) -> CubicSpline:
        """x against the logarithm of -dC/d(x^2), the price of a square at which it is the best."""
        t, x = self._table
        found = self.machine.good_parts(t)
        price = -found.cost_slope / (2.0 * x * self.scale * found.std_slope)
        order = np.log(np.maximum(price[::-1], 1e-300))
        kept = np.concatenate([[True], np.diff(np.maximum.accumulate(order)) > 0.0])
        return CubicSpline(order[kept], x[::-1][kept])

    def _by_square(self, square: Array) -> Array:
        spline = self._worth
        with np.errstate(divide="ignore"):
            at = np.clip(np.log(square), spline.x[0], spline.x[-1])
        return np.asarray(spline(at))

    def _by_both(self, linear: Array, square: Array, low: float, high: float) -> Array:
        """By a root of the derivative in t, which rises where the cost is convex in x."""

        def rise(t: Array, p: Array, q: Array) -> Array:
            found = self.machine.good_parts(t)
            x, slope = self.scale * found.std, self.scale * found.std_slope
            return found.cost_slope / slope + p + 2.0 * q * x

        first, last = (np.full_like(linear, end) for end in (low, high))
        falls, rises = rise(last, linear, square) <= 0.0, rise(first, linear, square) >= 0.0
        t, inner = np.where(falls, high, low), ~(falls | rises)
        if np.any(inner):
            t[inner] = find_root(rise, (low, high), args=(linear[inner], square[inner])).x
        return self.scale * self.machine.good_parts(t).std


def convex_cost(curve: GoodPartsBySpread) -> tuple[CostCurve, bool]:
    """A convex curve that is nowhere above the cost, and whether it is the cost itself.

    The cost of a good part is convex in its scatter for a centred machine without rework, and with
    it to limits of 4 sigma; elsewhere that is tried at `KNOTS` limits. Where it is not convex its
    convex hull takes its place, as a table.
    """
    t, x = curve._table
    found = curve.machine.good_parts(t)
    slope = found.cost_slope / found.std_slope
    if np.all(np.diff(slope) >= -1e-9 * np.ptp(slope)) and np.all(slope <= 0.0):
        return curve, True
    cost = np.minimum.accumulate(found.cost)
    hull = _hull(x, cost)
    table = Table(tuple(x[hull].tolist()), tuple(cost[hull].tolist()))
    fine = np.interp(np.linspace(0, len(t) - 1, FINE * len(t)), np.arange(len(t)), t)
    parts = curve.machine.good_parts(fine)
    at = np.clip(curve.scale * parts.std, x[0], x[-1])
    above = max(0.0, float(np.max(table.cost(at) - parts.cost)))
    lower = tuple((np.array(table.cost_at) - above * (1.0 + 1e-6)).tolist())
    return replace(table, cost_at=lower), False


def _hull(x: Array, y: Array) -> list[int]:
    """Places of the lower convex hull of points in order of x (Andrew's monotone chain)."""
    found: list[int] = []
    for at in range(len(x)):
        while len(found) > 1:
            i, j = found[-2:]
            if (x[j] - x[i]) * (y[at] - y[i]) - (y[j] - y[i]) * (x[at] - x[i]) > 0.0:
                break
            found.pop()
        found.append(at)
    return found
