"""Reciprocal cost curve."""

from __future__ import annotations

from dataclasses import dataclass

from ...arrays import Array
from .curve import CostCurve
from .reciprocal_power import stationary_power


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
