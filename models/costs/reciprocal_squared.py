"""Reciprocal squared cost curve."""

from __future__ import annotations

from dataclasses import dataclass

from ...arrays import Array
from .curve import CostCurve
from .reciprocal_power import stationary_power


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
