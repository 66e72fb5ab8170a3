"""Reciprocal power cost curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .curve import CostCurve

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
