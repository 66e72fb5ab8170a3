"""Combined reciprocal power and exponential cost curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .curve import CostCurve


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
