"""Several curves of the reciprocal family combined: whole matrices of tolerances at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .curve import CostCurve
from .reciprocal import Reciprocal
from .reciprocal_power import ReciprocalPower, stationary_power
from .reciprocal_squared import ReciprocalSquared

EXPONENTS = {Reciprocal: 1.0, ReciprocalSquared: 2.0}


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """C_j(t) = a_j + b_j/t^k_j of features j; coefficients (features,), tolerances (n, features).

    k is a single number where it is the same for all.
    """

    a: Array
    b: Array
    k: float | Array

    @classmethod
    def of(cls, curves: Sequence[CostCurve]) -> Joint | None:
        """The curves combined; None where a curve is of another family."""
        coefficients = []
        for curve in curves:
            if not isinstance(curve, Reciprocal | ReciprocalSquared | ReciprocalPower):
                return None
            k = curve.k if isinstance(curve, ReciprocalPower) else EXPONENTS[type(curve)]
            coefficients.append((curve.a, curve.b, k))
        a, b, k_of = np.array(coefficients, dtype=float).T
        return cls(a, b, float(k_of[0]) if np.all(k_of == k_of[0]) else k_of)

    def cost(self, t: Array) -> Array:
        """C (n, features)."""
        return np.asarray(self.a + self.b / (t if np.all(self.k == 1.0) else t**self.k))

    def stationary(self, linear: Array, square: Array) -> Array | None:
        """As `CostCurve.stationary`, for prices (n, features)."""
        return stationary_power(self.b, self.k, linear, square)
