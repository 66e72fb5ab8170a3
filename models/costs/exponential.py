"""Exponential cost curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .curve import Array, CostCurve, not_negative


@dataclass(frozen=True, slots=True)
class Exponential(CostCurve):
    """C(t) = a + b exp(-m t).

    Reference: Speckhart (1972), Calculation of tolerance based on a minimum cost approach,
    J. Engineering for Industry 94(2), 447-453.
    """

    a: float
    b: float
    m: float

    def cost(self, t: Array) -> Array:
        return self.a + self.b * np.exp(-self.m * t)

    def slope(self, t: Array) -> Array:
        return -self.m * self.b * np.exp(-self.m * t)

    def faults(self) -> list[tuple[str, str]]:
        return not_negative(self, ("b", "m"))
