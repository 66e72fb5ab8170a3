"""Cost-tolerance curves; `CURVES` maps their configuration names."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import ClassVar

import numpy as np
from scipy.special import wrightomega

from ..registry import Kinds
from ..section import Array
from .roots import bracketed_roots

__all__ = [
    "CURVES",
    "Combined",
    "CostCurve",
    "Exponential",
    "Reciprocal",
    "ReciprocalPower",
    "ReciprocalSquared",
    "Table",
]

# The interface of a cost-tolerance curve.


class CostCurve(ABC):
    """Relative cost C(t) of holding a tolerance t > 0 (in the unit of its variable).

    Manufacturing cost falls as the tolerance widens: `slope` is negative or zero everywhere.
    """

    not_negative: ClassVar[tuple[str, ...]] = ()
    """Coefficients that must not be below 0: the cost would rise with the tolerance."""

    @abstractmethod
    def cost(self, t: Array) -> Array:
        """C(t), same shape as t."""

    @abstractmethod
    def slope(self, t: Array) -> Array:
        """dC/dt, same shape as t."""

    @property
    def bends(self) -> tuple[float, ...]:
        """Tolerances at which C bends down: between them it is convex."""
        return ()

    @property
    def priced(self) -> bool:
        """Whether the curve is given by the prices of its t^2: `best` then costs less than C."""
        return False

    @property
    def smooth(self) -> bool:
        """Whether the slope of C is continuous."""
        return True

    def best(self, linear: Array, square: Array, low: float, high: float) -> Array:
        """The t in [low, high] that minimises C(t) + linear t + square t^2, shape (n,).

        `linear` and `square` (n,) are the prices of a tolerance, square >= 0; 0 < low <= high.
        """
        stationary = self.stationary(linear, square)
        if stationary is None:
            return self._root(linear, square, low, high)
        return np.clip(stationary, low, high)

    def stationary(self, linear: Array, square: Array) -> Array | None:
        """The stationary point in closed form, inf where there is none; None if not known."""
        return None

    def _root(self, linear: Array, square: Array, low: float, high: float) -> Array:
        """`best` by a safeguarded root of the derivative, which rises with t."""

        def rise(x: Array, p: Array, q: Array) -> Array:
            t = np.exp(x)
            return t * (self.slope(t) + p + 2.0 * q * t)

        ends = np.log(low), np.log(high)
        falls = rise(np.full_like(linear, ends[1]), linear, square) <= 0.0
        rises = rise(np.full_like(linear, ends[0]), linear, square) >= 0.0
        minimum = np.where(falls, high, low)
        inner = ~(falls | rises)
        if np.any(inner):
            minimum[inner] = np.exp(bracketed_roots(rise, ends, linear[inner], square[inner]).x)
        return np.clip(minimum, low, high)

    def faults(self) -> list[tuple[str, str]]:
        """(field, message) for every coefficient that makes the curve rise or meaningless."""
        reason = "must not be negative (the cost would rise with the tolerance)"
        values = {name: float(getattr(self, name)) for name in self.not_negative}
        return [(name, f"{reason}, got {value:g}") for name, value in values.items() if value < 0]


# Combined reciprocal power and exponential cost curve.


@dataclass(frozen=True, slots=True)
class Combined(CostCurve):
    """C(t) = a + b/t^k + c exp(-m t).

    Reference: Michael & Siddall (1981), The optimization problem with optimal tolerance assignment
    and full acceptance, J. Mechanical Design 103(4), 842-848, and its additive variant in
    Dong, Hu & Xue (1994), J. Engineering for Industry 116(1), 54-63.
    """

    not_negative = ("b", "k", "c", "m")

    a: float
    b: float
    k: float
    c: float
    m: float

    def cost(self, t: Array) -> Array:
        return self.a + self.b / t**self.k + self.c * np.exp(-self.m * t)

    def slope(self, t: Array) -> Array:
        power = -self.k * self.b / t ** (self.k + 1.0)
        return power - self.m * self.c * np.exp(-self.m * t)


# Exponential cost curve.


STRAIGHT = 1e8
"""Ratio of the prices above which that of the square is negligible."""


@dataclass(frozen=True, slots=True)
class Exponential(CostCurve):
    """C(t) = a + b exp(-m t).

    Reference: Speckhart (1972), Calculation of tolerance based on a minimum cost approach,
    J. Engineering for Industry 94(2), 447-453.
    """

    not_negative = ("b", "m")

    a: float
    b: float
    m: float

    def cost(self, t: Array) -> Array:
        return self.a + self.b * np.exp(-self.m * t)

    def slope(self, t: Array) -> Array:
        return -self.m * self.b * np.exp(-self.m * t)

    def stationary(self, linear: Array, square: Array) -> Array | None:
        """m b exp(-m t) = p + 2 q t by Wright's omega function, for q = 0 by a logarithm.

        A last step of Newton's method restores the digits that the difference loses.
        """
        if self.b == 0.0 or self.m == 0.0 or np.any(linear < 0.0):
            return None
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            linear = linear + 0.0  # no negative zero
            alone = np.log(self.m * self.b / linear) / self.m
            shift = 0.5 * linear / square
            bent = wrightomega(np.log(0.5 * self.m**2 * self.b / square) + self.m * shift)
            straight = ~(self.m * shift < STRAIGHT)
            t = np.where(straight, alone, bent / self.m - shift)
            level = linear + 2.0 * square * t
            step = (np.log(self.m * self.b / level) - self.m * t) / (self.m + 2.0 * square / level)
        return np.asarray(np.where(np.isfinite(step), t + step, t))


# Reciprocal power cost curve.


STEPS = 6
"""Newton steps: the error falls at least by a third in the first and is squared after."""


@dataclass(frozen=True, slots=True)
class ReciprocalPower(CostCurve):
    """C(t) = a + b/t^k, k > 0.

    Reference: Sutherland & Roth (1975), Mechanism design: accounting for manufacturing tolerances
    and costs in function generating problems, J. Engineering for Industry 97(1), 283-286.
    """

    not_negative = ("b", "k")

    a: float
    b: float
    k: float

    def cost(self, t: Array) -> Array:
        return self.a + self.b / t**self.k

    def slope(self, t: Array) -> Array:
        return -self.k * self.b / t ** (self.k + 1.0)

    def stationary(self, linear: Array, square: Array) -> Array | None:
        return stationary_power(self.b, self.k, linear, square)


def stationary_power(b: float | Array, k: float | Array, linear: Array, square: Array) -> Array | None:
    """The t at which k b / t^(k + 1) = linear + 2 square t; inf where the cost falls for ever.

    With both prices, Newton's method on the logarithm of both sides in x = ln t. Their difference
    is concave with a slope between -(k + 2) and -(k + 1), so that it converges from everywhere, and
    `STEPS` steps are more than enough for the last digit.
    """
    if np.any(b == 0.0) or np.any(linear < 0.0):
        return None
    linear = linear + 0.0  # no negative zero: it has no price, and its reciprocal no root
    with np.errstate(divide="ignore", over="ignore"):
        by_linear = _root(k * b / linear, k + 1.0)
        if not np.any(square):
            return by_linear
        by_square = _root(0.5 * k * b / square, k + 2.0)
        if not np.any(linear):
            return by_square
    free = (linear == 0.0) & (square == 0.0)
    x = np.log(np.where(free, 1.0, np.minimum(by_linear, by_square)))
    for _ in range(STEPS):
        bent = 2.0 * square * np.exp(x)
        level = linear + bent
        x = x + (np.log(k * b / level) - (k + 1.0) * x) / (k + 1.0 + bent / level)
    return np.where(free, np.inf, np.exp(x))


def _root(x: Array, order: float | Array) -> Array:
    """x^(1/order); square and cube roots are several times faster than a power."""
    roots = {2.0: np.sqrt, 3.0: np.cbrt}
    if isinstance(order, float) and order in roots:
        return np.asarray(roots[order](x))
    return np.asarray(x ** (1.0 / order))


# Reciprocal cost curve.


@dataclass(frozen=True, slots=True)
class Reciprocal(CostCurve):
    """C(t) = a + b/t.

    Reference: Chase & Greenwood (1988), Design issues in mechanical tolerance analysis,
    Manufacturing Review 1(1), 50-59.
    """

    not_negative = ("b",)

    a: float
    b: float

    def cost(self, t: Array) -> Array:
        return self.a + self.b / t

    def slope(self, t: Array) -> Array:
        return -self.b / t**2

    def stationary(self, linear: Array, square: Array) -> Array | None:
        return stationary_power(self.b, 1.0, linear, square)


# Reciprocal squared cost curve.


@dataclass(frozen=True, slots=True)
class ReciprocalSquared(CostCurve):
    """C(t) = a + b/t^2.

    Reference: Spotts (1973), Allocation of tolerances to minimize cost of assembly, J. Engineering
    for Industry 95(3), 762-764.
    """

    not_negative = ("b",)

    a: float
    b: float

    def cost(self, t: Array) -> Array:
        return self.a + self.b / t**2

    def slope(self, t: Array) -> Array:
        return -2.0 * self.b / t**3

    def stationary(self, linear: Array, square: Array) -> Array | None:
        return stationary_power(self.b, 2.0, linear, square)


# Tabulated cost curve: grade or tolerance against cost.


@dataclass(frozen=True, slots=True)
class Table(CostCurve):
    """Cost at listed tolerances (or grades), linear between them; not defined outside the list.

    `t` rises strictly. Where `cost_at` rises, the lower cost of a tighter tolerance counts, since
    the part may be made to that tolerance. At a listed tolerance the slope is that of the interval
    above it, at the last that of the interval below. Outside the list C is infinite: there is no
    price for that tolerance.
    """

    t: tuple[float, ...]
    cost_at: tuple[float, ...]

    @property
    def least(self) -> tuple[float, ...]:
        """Least cost over each listed tolerance and all tighter ones."""
        return tuple(accumulate(self.cost_at, min))

    @property
    def rising(self) -> tuple[float, ...]:
        """Listed tolerances that cost more than a tighter one."""
        return tuple(t for t, cost, least in zip(self.t, self.cost_at, self.least, strict=True) if cost > least)

    def cost(self, t: Array) -> Array:
        return np.interp(t, self.t, self.least, left=np.inf, right=np.inf)

    def slope(self, t: Array) -> Array:
        knots, slopes = np.array(self.t), np.diff(self.least) / np.diff(self.t)
        at = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(slopes) - 1)
        return np.where((t < knots[0]) | (t > knots[-1]), np.nan, slopes[at])

    @property
    def bends(self) -> tuple[float, ...]:
        slopes = np.diff(self.least) / np.diff(self.t)
        return tuple(t for t, bend in zip(self.t[1:-1], np.diff(slopes), strict=True) if bend < 0.0)

    @property
    def smooth(self) -> bool:
        return len(self.t) == 2

    def best(self, linear: Array, square: Array, low: float, high: float) -> Array:
        """As in the base class; global although a table need not be convex.

        The candidates are the ends, the entries between, and the stationary point of each piece.
        """
        inner = [t for t in self.t if low < t < high]
        knots = np.array([low, *inner, high])
        slopes = self.slope(0.5 * (knots[1:] + knots[:-1]))
        with np.errstate(divide="ignore", invalid="ignore"):
            free = -(slopes[:, None] + linear) / (2.0 * square)
        free = np.clip(np.where(np.isnan(free), low, free), knots[:-1, None], knots[1:, None])
        fixed = np.broadcast_to(knots[:, None], (len(knots), len(linear)))
        candidates = np.vstack([fixed, free])
        values = self.cost(candidates) + linear * candidates + square * candidates**2
        return np.asarray(candidates[np.argmin(values, axis=0), np.arange(len(linear))])

    def faults(self) -> list[tuple[str, str]]:
        if len(self.t) != len(self.cost_at) or len(self.t) < 2:
            return [
                ("t", f"needs at least two entries, and as many as cost_at, got {len(self.t)} and {len(self.cost_at)}")
            ]
        rises = all(before < after for before, after in pairwise(self.t))
        return [] if rises else [("t", "must increase from entry to entry")]


CURVES: Kinds[CostCurve] = Kinds("curves")
"""Plugins included."""
