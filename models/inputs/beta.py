"""Beta input: any unimodal, skewed, one-ended or U-shaped spread between the limits."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.special import betainc, betaincinv, betaln, xlog1py, xlogy

from ...arrays import Array
from .distribution import GRAIN, WithinZone, coarse


@dataclass(frozen=True, slots=True)
class Beta(WithinZone):
    """z on [-1, 1] with a density proportional to (1 + z)^(alpha - 1) (1 - z)^(beta - 1).

    `alpha`, `beta` > 0 without default: 1, 1 is uniform, below 1 the density has a pole at that
    limit. It fills the zone, so that it has no Cp and no shift. Mean (alpha - beta)/(alpha + beta).

    Integrating d[z^k (1 - z^2) f(z)] gives both the raw moments,
    m_(k+1) = (k m_(k-1) + (alpha - beta) m_k)/(k + alpha + beta), whose terms never cancel, and the
    partial ones, in which (1 - z^2) f(z) is finite where f has its pole.

    Reference: Johnson, Kotz & Balakrishnan (1995), Continuous Univariate Distributions II, ch. 25.
    """

    alpha: float = field(metadata={"low": 0.0, "open_low": True})
    beta: float = field(metadata={"low": 0.0, "open_low": True})

    @property
    def grain(self) -> float:
        return GRAIN if min(self.alpha, self.beta) >= 1.0 else coarse(self)

    def raw_moments(self, order: int) -> Array:
        lean, total = self.alpha - self.beta, self.alpha + self.beta
        moments = np.ones(order + 1)
        for k in range(order):
            before = k * moments[k - 1] if k > 0 else 0.0
            moments[k + 1] = (before + lean * moments[k]) / (k + total)
        return moments

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        u = np.clip(z, -1.0, 1.0)
        x = 0.5 * (1.0 + u)
        lean, total = self.alpha - self.beta, self.alpha + self.beta
        power = xlogy(self.alpha, x) + xlog1py(self.beta, -x)
        edge = 2.0 * np.exp(power - betaln(self.alpha, self.beta))  # (1 - z^2) f(z)
        mass = betainc(self.alpha, self.beta, x)
        first = (lean * mass - edge) / total
        second = (mass + lean * first - u * edge) / (total + 1.0)
        return mass, first, second

    def quantile(self, probability: Array) -> Array:
        return np.asarray(2.0 * betaincinv(self.alpha, self.beta, probability) - 1.0)
