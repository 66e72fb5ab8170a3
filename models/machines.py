"""Machines whose scatter does not depend on the tolerance, with and without inspection."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import ndtr

from ..section import Array
from .costs import CostCurve, Reciprocal, Table
from .inputs import density

__all__ = ["ConvexHull", "GoodPartsByLimit", "GoodPartsBySpread", "Machine", "at_prices", "convex_cost"]

# The parts of a machine: scatter, mean, yield and cost of the good ones.
#
# A machine makes x ~ N(o, sigma^2). Inspection measures x + e, e ~ N(0, u^2), and passes a part whose
# measurement lies within +-w, w = t - k u: the limits +-t less a guard band of k u at each (ISO
# 14253-1; k = 1.645 leaves 5 % of the parts on a limit to be accepted wrongly). The measurements are
# normal with the variance S^2 = sigma^2 + u^2, those of good parts are truncated at a = (-w - o)/S
# and b = (w - o)/S:
#
#     Y    = Phi(b) - Phi(a)                                            yield
#     m_r  = o - S (phi(b) - phi(a))/Y                                  mean of measurements
#     s_r^2 = S^2 (1 - (b phi(b) - a phi(a))/Y - ((phi(b) - phi(a))/Y)^2)   their variance
#
# Given its measurement m a part is normal about o + r (m - o), r = sigma^2/S^2, with the variance
# r u^2, so that good parts have mean o + r (m_r - o) and variance r^2 s_r^2 + r u^2. For u = 0 and
# o = 0 this is sigma^2 (1 - 2 tau phi(tau)/(2 Phi(tau) - 1)), tau = t/sigma. Reference: Johnson, Kotz
# & Balakrishnan (1994), Continuous Univariate Distributions 1, section 13.10.1.


GUARD = 1.645
"""Guard band in units of the standard uncertainty: 5 % risk for a part on the limit."""
SIDES = ("upper", "lower", "both")
"""Which rejected parts can be reworked."""


@dataclass(frozen=True, slots=True)
class Rework:
    """Rework of rejected parts on a `side` at a `price`, with a fraction `success`."""

    price: float
    success: float = 1.0
    side: str = "upper"


@dataclass(frozen=True, slots=True)
class Inspection:
    """Inspection of every part at a `price`, with the standard uncertainty `u`.

    With `scrap` a rejected part is lost; otherwise it is used elsewhere at its price.
    """

    price: float
    u: float = 0.0
    guard: float = GUARD
    scrap: bool = True
    rework: Rework | None = None


@dataclass(frozen=True, slots=True)
class GoodParts:
    """The good parts of a machine, all of one shape: fraction `passed`, mean, standard deviation,
    cost of a good part, and derivatives of the last three by the limit t.
    """

    passed: Array
    mean: Array
    std: Array
    cost: Array
    mean_slope: Array
    std_slope: Array
    cost_slope: Array


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine: standard deviation and mean (from the mid-limit) of its parts, price of a part.

    Lengths are in the unit of the part. Without an inspection every part counts as good.
    """

    name: str
    sigma: float
    price: float
    mean: float = 0.0
    inspection: Inspection | None = None

    @property
    def prices(self) -> tuple[float, float, float]:
        """Price of a part, its inspection and a rework, 0 where there is none; costs are linear in them."""
        rework = self.inspection and self.inspection.rework
        return self.price, self.inspection.price if self.inspection else 0.0, rework.price if rework else 0.0

    def with_prices(self, price: float, inspection: float = 0.0, rework: float = 0.0) -> Machine:
        """The machine at other prices."""
        stated = self.inspection
        if stated is not None:
            stated = replace(stated, price=inspection, rework=stated.rework and replace(stated.rework, price=rework))
        return replace(self, price=price, inspection=stated)

    @property
    def natural(self) -> float:
        """The half-width that it achieves without inspection: 3 sigma plus |mean|."""
        return 3.0 * self.sigma + abs(self.mean)

    @property
    def measured_std(self) -> float:
        """Standard deviation of the measurements of an inspection."""
        u = self.inspection.u if self.inspection else 0.0
        return float(np.hypot(self.sigma, u))

    @property
    def guard_band(self) -> float:
        """Distance from each limit within which an inspection rejects parts."""
        return self.inspection.guard * self.inspection.u if self.inspection else 0.0

    def passed(self, t: Array) -> Array:
        """Fraction of the parts that an inspection at limits +-t passes."""
        w = t - self.guard_band
        return _probability_between((-w - self.mean) / self.measured_std, (w - self.mean) / self.measured_std)

    def good_parts(self, t: Array) -> GoodParts:
        """The good parts at limits +-t, t above the guard band."""
        if self.inspection is None:
            ones, zeros = np.ones_like(t), np.zeros_like(t)
            return GoodParts(ones, ones * self.mean, ones * self.sigma, ones * self.price, zeros, zeros, zeros)
        w, scale, o = t - self.guard_band, self.measured_std, self.mean
        a, b = (-w - o) / scale, (w - o) / scale
        at_a, at_b = (density(end) / scale for end in (a, b))
        passed = _probability_between(a, b)
        mean = o - scale**2 * (at_b - at_a) / passed
        variance = scale**2 * (1.0 - (b * at_b - a * at_a) * scale / passed) - (mean - o) ** 2
        reliability = (self.sigma / scale) ** 2
        spread = reliability**2 * variance + reliability * self.inspection.u**2
        std = np.sqrt(spread)
        mean_slope = (at_b * (w - mean) - at_a * (w + mean)) / passed
        rise = (at_b * ((w - mean) ** 2 - variance) + at_a * ((w + mean) ** 2 - variance)) / passed
        cost, cost_slope = self._cost(passed, at_a + at_b, (a, b), (at_a, at_b))
        return GoodParts(
            passed=passed,
            mean=o + reliability * (mean - o),
            std=std,
            cost=cost,
            mean_slope=reliability * mean_slope,
            std_slope=0.5 * reliability**2 * rise / std,
            cost_slope=cost_slope,
        )

    def _cost(
        self, passed: Array, rise: Array, ends: tuple[Array, Array], density: tuple[Array, Array]
    ) -> tuple[Array, Array]:
        """Cost of a good part and its derivative by t; `rise` is that of the fraction passed.

        (p + i + q (rho + i))/(Y + q f): q is the fraction reworked at rho, f of which passes.
        """
        inspection = self.inspection
        assert inspection is not None
        reworked, reworked_slope = np.zeros_like(passed), np.zeros_like(passed)
        rework_cost, success = 0.0, 0.0
        if (rework := inspection.rework) is not None:
            rework_cost, success = rework.price + inspection.price, rework.success
            if rework.side in ("upper", "both"):
                reworked, reworked_slope = reworked + ndtr(-ends[1]), reworked_slope - density[1]
            if rework.side in ("lower", "both"):
                reworked, reworked_slope = reworked + ndtr(ends[0]), reworked_slope - density[0]
        good, good_slope = passed + success * reworked, rise + success * reworked_slope
        scrap_cost = self.price if inspection.scrap else 0.0
        spent = scrap_cost + inspection.price + rework_cost * reworked
        spent_slope = rework_cost * reworked_slope
        base_cost = 0.0 if inspection.scrap else self.price
        return base_cost + spent / good, (spent_slope - spent / good * good_slope) / good


def _probability_between(a: Array, b: Array) -> Array:
    """Phi(b) - Phi(a), on the side where it does not cancel."""
    turned = a + b > 0.0
    return np.asarray(np.where(turned, ndtr(-a) - ndtr(-b), ndtr(b) - ndtr(a)))


# Costs of good parts as cost curves: by the limit of inspection, and by their scatter.


KNOTS = 2049
"""Limits at which scatter and cost are tabulated for their inverses."""
STEPS = 1
"""Steps of Newton's method from the tabulated inverse, which is right to eight digits."""
SAMPLES_PER_INTERVAL = 16
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

    def at_prices_of(self, machine: Machine) -> GoodPartsBySpread:
        """The same at the prices of another; limits by x do not depend on these, so that both have them in common."""
        other = replace(self, machine=machine)
        vars(other).update({name: getattr(self, name) for name in ("_table", "_rising", "_inverse")})
        return other

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


@dataclass(frozen=True, slots=True)
class ConvexHull(Table):
    """A convex table that is nowhere above the cost of good parts `of` a machine."""

    of: CostCurve


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
    table = ConvexHull(tuple(x[hull].tolist()), tuple(cost[hull].tolist()), curve)
    fine = np.interp(np.linspace(0, len(x) - 1, SAMPLES_PER_INTERVAL * len(x)), np.arange(len(x)), x)
    above = max(0.0, float(np.max(table.cost(fine) - curve.cost(fine))))
    lower = tuple((np.array(table.cost_at) - above * (1.0 + 1e-6)).tolist())
    return replace(table, cost_at=lower), False


def at_prices(curve: CostCurve, machine: Machine, low: float, high: float) -> CostCurve:
    """The curve at the prices of another machine, or its hull as by `convex_cost`, from `low` to `high`."""
    if machine.inspection is None:
        return Reciprocal(machine.price, 0.0)
    if isinstance(curve, GoodPartsBySpread):
        priced = curve.at_prices_of(machine)
        return convex_cost(priced, priced.tabulated)[0]
    return convex_cost(GoodPartsByLimit(machine), np.linspace(low, high, KNOTS))[0]


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
