"""Exponential cost curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import wrightomega

from ...arrays import Array
from .curve import CostCurve

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
