"""Densities that rise in a line, stay level and fall in a line: triangle and trapezoid."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from ...arrays import Array
from .distribution import WithinZone

TINY = np.finfo(float).tiny


class Plateau(WithinZone):
    """z on [-1, 1] with a density that is level between two points and falls to 0 at the limits.

    With the level part from l to r and the height 1/a, a = 1 + (r - l)/2:
    E[z^k] = (sum_i r^i - sum_i l^i (-1)^(k+1-i)) / (a (k + 1) (k + 2)), i = 0 .. k + 1, from the
    second differences of z^(k+2); no term cancels as a ramp becomes short.
    """

    @property
    @abstractmethod
    def level(self) -> tuple[float, float]:
        """The two ends (l, r) of the level part, -1 <= l <= r <= 1."""

    @property
    def _area(self) -> float:
        """Area under the density of height 1."""
        left, right = self.level
        return 1.0 + 0.5 * (right - left)

    def raw_moments(self, order: int) -> Array:
        left, right = self.level
        i = np.arange(order + 2)
        rising, falling = np.cumsum(right**i), np.cumsum((-left) ** i)
        k = np.arange(order + 1)
        moments = rising[1:] + np.where(k % 2 == 0, 1.0, -1.0) * falling[1:]
        return np.asarray(moments / (self._area * (k + 1) * (k + 2)))

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        left, right = self.level
        u = np.clip(z, -1.0, 1.0)
        mass, first, second = _ramp(np.minimum(u, left) + 1.0, 1.0 + left)
        full = _ramp(np.asarray(1.0 - right), 1.0 - right)
        above = _ramp(1.0 - np.maximum(u, right), 1.0 - right)
        flat = np.clip(u, left, right)
        mass = mass + (flat - left) + (full[0] - above[0])
        first = first + 0.5 * (flat**2 - left**2) - (full[1] - above[1])
        second = second + (flat**3 - left**3) / 3.0 + (full[2] - above[2])
        return mass / self._area, first / self._area, second / self._area

    def quantile(self, probability: Array) -> Array:
        left, right = self.level
        below, above = self._area * probability, self._area * (1.0 - probability)
        rising = np.sqrt(2.0 * below * (1.0 + left)) - 1.0
        falling = 1.0 - np.sqrt(2.0 * above * (1.0 - right))
        flat = np.clip(left + below - 0.5 * (1.0 + left), left, right)
        start, end = 0.5 * (1.0 + left), 0.5 * (1.0 - right)
        return np.where(below < start, rising, np.where(above < end, falling, flat))


def _ramp(run: Array, length: float) -> tuple[Array, Array, Array]:
    """Integrals of u^k (u + 1)/length from -1 to -1 + run, k = 0, 1, 2."""
    fraction = run / max(length, TINY)  # a ramp of no length has run = 0
    square = run * fraction
    return (0.5 * square, square * (run / 3.0 - 0.5), square * (0.25 * run**2 - 2.0 * run / 3.0 + 0.5))
