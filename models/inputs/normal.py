"""Normal input with process capability Cp and a mean shift."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtr, ndtri

from ...arrays import Array
from .distribution import Distribution

TAIL = 8.0
"""Standard deviations on either side that count; beyond them lies 1.2e-15 of the mass."""


def density(x: Array) -> Array:
    """Standard normal density."""
    return np.asarray(np.exp(-0.5 * x * x) / np.sqrt(2.0 * np.pi))


@dataclass(frozen=True, slots=True)
class Normal(Distribution):
    """z normal with mean `shift` and standard deviation 1/(3 Cp).

    `cp` is the process capability (zone width over six standard deviations), > 0. `shift` is the
    shift of the process mean from the mid-limit as a fraction of the half-width, in [-1, 1]; the
    one-sided capability is then Cpk = Cp (1 - |shift|).

    Reference: Kane (1986), Process capability indices, J. Quality Technology 18(1), 41-52; the
    fractional mean shift is that of Chase & Greenwood (1988), Manufacturing Review 1(1), 50-59.
    """

    cp: float = field(default=1.0, metadata={"low": 0.0, "open_low": True})
    shift: float = field(default=0.0, metadata={"low": -1.0, "high": 1.0})

    @property
    def sigma(self) -> float:
        """Standard deviation of z."""
        return 1.0 / (3.0 * self.cp)

    @property
    def support(self) -> tuple[float, float]:
        return self.shift - TAIL * self.sigma, self.shift + TAIL * self.sigma

    def raw_moments(self, order: int) -> Array:
        moments = np.zeros(order + 1)
        moments[0] = 1.0
        for k in range(1, order + 1):
            before = (k - 1) * self.sigma**2 * moments[k - 2] if k > 1 else 0.0
            moments[k] = self.shift * moments[k - 1] + before
        return moments

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        x = (z - self.shift) / self.sigma
        mass, peak = ndtr(x), self.sigma * density(x)
        first = self.shift * mass - peak
        second = (self.shift**2 + self.sigma**2) * mass - (self.shift + z) * peak
        return mass, first, second

    def quantile(self, probability: Array) -> Array:
        x = np.clip(ndtri(probability), -TAIL, TAIL)
        return np.asarray(self.shift + self.sigma * x)
