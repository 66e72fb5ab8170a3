"""Normal input with sorting: no part outside the zone is assembled."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache

import numpy as np
from scipy.special import ndtr, ndtri

from ...arrays import Array
from .distribution import WithinZone
from .normal import density

REACH = 12.0
"""Standard deviations beyond which the density is neglected."""


@dataclass(frozen=True, slots=True)
class TruncatedNormal(WithinZone):
    """z normal with mode `shift` and scale 1/(3 Cp), cut at the limits -1 and +1.

    `cp` and `shift` are those of the process before inspection, as in `Normal`. Raw moments are by
    Gauss-Legendre quadrature: the closed recursion (Johnson, Kotz & Balakrishnan, Continuous
    Univariate Distributions I, ch. 13) loses all digits for small Cp.
    """

    cp: float = field(default=1.0, metadata={"low": 0.0, "open_low": True})
    shift: float = field(default=0.0, metadata={"low": -1.0, "high": 1.0})

    @property
    def sigma(self) -> float:
        """Scale of the process before inspection, in half-widths."""
        return 1.0 / (3.0 * self.cp)

    def _cuts(self) -> tuple[float, float]:
        return (-1.0 - self.shift) / self.sigma, (1.0 - self.shift) / self.sigma

    def raw_moments(self, order: int) -> Array:
        low = max(-1.0, self.shift - REACH * self.sigma)
        high = min(1.0, self.shift + REACH * self.sigma)
        node, gauss = _quadrature()
        z = 0.5 * (low + high) + 0.5 * (high - low) * node
        weight = gauss * density((z - self.shift) / self.sigma)
        return np.asarray(z ** np.arange(order + 1)[:, None] @ weight / weight.sum())

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        low, high = self._cuts()
        x = np.clip((z - self.shift) / self.sigma, low, high)
        edge, start = self.sigma * density(x), self.sigma * float(density(np.array(low)))
        total = float(ndtr(high) - ndtr(low))
        mass = ndtr(x) - ndtr(low)
        u = self.shift + self.sigma * x
        first = self.shift * mass - (edge - start)
        second = (self.shift**2 + self.sigma**2) * mass - ((self.shift + u) * edge - (self.shift - 1.0) * start)
        return mass / total, first / total, second / total

    def quantile(self, probability: Array) -> Array:
        low, high = self._cuts()
        x = ndtri(ndtr(low) + probability * (ndtr(high) - ndtr(low)))
        return np.clip(self.shift + self.sigma * x, -1.0, 1.0)


@cache
def _quadrature() -> tuple[Array, Array]:
    """Nodes and weights on -1 to 1, exact to rounding for a normal density; 10 ms to find."""
    node, weight = np.polynomial.legendre.leggauss(96)
    node.setflags(write=False)
    weight.setflags(write=False)
    return node, weight
