"""The most unfavourable processes that samples allow, to first order in their effect on a value.

Let independent processes have the posterior mean E of the variance ratio, G from there to its
upper confidence limit, and the limit z sqrt(E/n) standard deviations of the mean. The ellipsoid

    sum_j ((r_j - E_j)/G_j)^2 + sum_j (m_j/(z sqrt(E_j/n_j)))^2 <= b^2

is the region in which a promise must hold: for a sum of deviations and b = 1 that is the norm of
an assured promise. Its worst point for a value follows from slopes (first-order reliability).

Reference: Hasofer & Lind (1974), Exact and invariant second-moment code format, J. Engineering
Mechanics Division ASCE 100(1), 111-121.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from ..arrays import Array
from ..models.capability import Knowledge


@dataclass(frozen=True, eq=False)
class Worst:
    """Processes along the worst direction: ratios of variances `even` + b `growth`, errors of means
    b `shift` in estimated standard deviations, (k,) each.
    """

    even: Array
    growth: Array
    shift: Array

    @classmethod
    def of(cls, known: Sequence[Knowledge], by_scale: Array, by_shift: Array, confidence: float) -> Worst:
        """The direction, by derivatives (k,) of a value that is to be small.

        They are by the scale of each standard deviation, and by the error of each mean.
        """
        even = np.array([knowledge.inflation for knowledge in known])
        reach = np.array([knowledge.surplus_at(confidence) for knowledge in known])
        error = float(ndtri(confidence)) * np.sqrt(even / np.array([knowledge.n for knowledge in known]))
        steep = np.concatenate([0.5 * reach * np.maximum(by_scale, 0.0), error * by_shift])
        size = float(np.linalg.norm(steep))
        unit = steep / size if size > 0.0 else steep
        return cls(even, reach * unit[: len(known)], error * unit[len(known) :])

    def at(self, radius: float) -> tuple[Array, Array]:
        """Scales of standard deviations, and errors of means, (k,) each, at b."""
        ratio = np.maximum(self.even + radius * self.growth, 0.01)
        return np.sqrt(ratio), radius * self.shift
