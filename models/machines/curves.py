"""Costs of good parts as cost curves: by the limit of inspection, and by their scatter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from ...arrays import Array
from ..costs import CostCurve, Table
from .machine import Machine

KNOTS = 2049
"""Limits at which scatter and cost are tabulated for their inverses."""
STEPS = 1
"""Steps of Newton's method from the tabulated inverse, which is right to eight digits."""
FINE = 16
"""Points per interval of a hull at which it is tested to lie below the cost."""


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
    """Cost of a good part against x = `scale` times the standard deviation of good parts.

    Limits run from `low` to `high`. The scatter rises with the limit, so that x determines it.
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
    def tabulated(self) -> Array:
        """The x at which cost and limit are tabulated, rising."""
        return self._slopes[0]

    @property
    def ends(self) -> tuple[float, float]:
        """Least and largest x."""
        x = self._table[1]
        return float(x[0]), float(x[-1])

    @cached_property
    def _rising(self) -> NDArray[np.bool_]:
        """Where x is above all x before it."""
        return np.concatenate([[True], np.diff(np.maximum.accumulate(self._table[1])) > 0.0])

    @cached_property
    def _inverse(self) -> scipy.interpolate.PchipInterpolator:
        t, x = self._table
        return scipy.interpolate.PchipInterpolator(x[self._rising], t[self._rising])

    def limit(self, x: Array) -> Array:
        """The limit t of an inspection whose good parts have the scatter x."""
        t = np.clip(self._inverse(np.clip(x, *self.ends)), self.low, self.high)
        for _ in range(STEPS):
            good = self.machine.good_parts(t)
            rise = self.scale * good.std_slope
            step = (x - self.scale * good.std) / np.where(rise > 0.0, rise, np.inf)
            t = np.clip(t + step, self.low, self.high)
        return np.asarray(t)

    def cost(self, t: Array) -> Array:
        return self.machine.good_parts(self.limit(np.asarray(t, dtype=float))).cost

    def slope(self, t: Array) -> Array:
        good = self.machine.good_parts(self.limit(np.asarray(t, dtype=float)))
        return np.asarray(good.cost_slope / (self.scale * good.std_slope))

    def best(self, linear: Array, square: Array, low: float, high: float) -> Array:
        """As in the base class, by bisection in the tabulated slope, which rises with x."""
        x, slope = self._slopes
        ends = np.array([low, high])
        at_low, at_high = np.interp(ends, x, slope)[:, None] + linear + 2.0 * square * ends[:, None]
        best = np.where(at_high <= 0.0, high, low)
        inner = np.flatnonzero((at_low < 0.0) & (at_high > 0.0))
        if len(inner):
            best[inner] = self._inside(linear[inner], square[inner], ends)
        return np.clip(best, low, high)

    def _inside(self, linear: Array, square: Array, ends: Array) -> Array:
        """Where the tabulated slope and prices (n,) add up to 0 between two ends."""
        x, slope = self._slopes
        before, after = np.searchsorted(x, ends).tolist()
        low, high = max(before - 1, 0), min(max(after, before), len(x) - 1)
        first, last = np.full(len(linear), low), np.full(len(linear), high)
        for _ in range((high - low).bit_length()):
            middle = (first + last) // 2
            above = slope[middle] + linear + 2.0 * square * x[middle] > 0.0
            first, last = np.where(above, first, middle), np.where(above, middle, last)
        at = np.minimum(first, len(x) - 2)  # the slope is not above 0 there, but at the next
        at_left = slope[at] + linear + 2.0 * square * x[at]
        at_right = slope[at + 1] + linear + 2.0 * square * x[at + 1]
        fraction = np.clip(-at_left / np.where(at_right > at_left, at_right - at_left, 1.0), 0.0, 1.0)
        return np.asarray(x[at] + fraction * (x[at + 1] - x[at]))

    @cached_property
    def _slopes(self) -> tuple[Array, Array]:
        """x and dC/dx, its running maximum, so that it rises with x."""
        t, x = self._table
        good = self.machine.good_parts(t)
        slope = good.cost_slope / (self.scale * good.std_slope)
        return x[self._rising], np.maximum.accumulate(slope[self._rising])


def convex_cost(curve: CostCurve, x: Array) -> tuple[CostCurve, bool]:
    """A convex curve that is nowhere above the cost from x[0] to x[-1], and whether it equals it.

    The cost of a good part is convex in its scatter for a centred machine without rework, and with
    it to limits of 4 sigma; elsewhere that is tested at `x` (n,). Where it is not convex, a table
    with its convex hull replaces it.
    """
    slope = curve.slope(x)
    if np.all(np.diff(slope) >= -1e-9 * np.ptp(slope)) and np.all(slope <= 0.0):
        return curve, True
    cost = np.minimum.accumulate(curve.cost(x))
    hull = _hull(x, cost)
    table = Table(tuple(x[hull].tolist()), tuple(cost[hull].tolist()))
    fine = np.interp(np.linspace(0, len(x) - 1, FINE * len(x)), np.arange(len(x)), x)
    above = max(0.0, float(np.max(table.cost(fine) - curve.cost(fine))))
    lower = tuple((np.array(table.cost_at) - above * (1.0 + 1e-6)).tolist())
    return replace(table, cost_at=lower), False


def _hull(x: Array, y: Array) -> list[int]:
    """Places of the lower convex hull of points in order of x (Andrew's monotone chain)."""
    hull: list[int] = []
    for at in range(len(x)):
        while len(hull) > 1:
            i, j = hull[-2:]
            if (x[j] - x[i]) * (y[at] - y[i]) - (y[j] - y[i]) * (x[at] - x[i]) > 0.0:
                break
            hull.pop()
        hull.append(at)
    return hull
