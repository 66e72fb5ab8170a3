"""Reciprocal power cost curve."""

from __future__ import annotations

from dataclasses import dataclass

from .curve import Array, CostCurve, not_negative


@dataclass(frozen=True, slots=True)
class ReciprocalPower(CostCurve):
    """C(t) = a + b/t^k, k > 0.

    Reference: Sutherland & Roth (1975), Mechanism design: accounting for manufacturing tolerances
    and costs in function generating problems, J. Engineering for Industry 97(1), 283-286.
    """

    a: float
    b: float
    k: float

    def cost(self, t: Array) -> Array:
        return self.a + self.b / t**self.k

    def slope(self, t: Array) -> Array:
        return -self.k * self.b / t ** (self.k + 1.0)

    def faults(self) -> list[tuple[str, str]]:
        return not_negative(self, ("b", "k"))
