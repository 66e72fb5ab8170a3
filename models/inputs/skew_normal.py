"""Skew normal input: a process that is skewed to one side, for example by tool wear or a stop."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from math import comb, gamma, hypot, pi, sqrt

import numpy as np
import scipy
from scipy.special import ndtr, owens_t

from ...arrays import Array
from .distribution import Distribution
from .normal import TAIL, density

OUTER = 1e-9
"""Probability of a tail in which quantiles are computed singly."""
REACH, NODES, STEPS = 7.0, 8193, 2
"""Ends of the table of masses, its nodes, and Newton's steps from there."""


@dataclass(frozen=True, slots=True)
class SkewNormal(Distribution):
    """z = shift + (Y - E[Y])/(3 Cp std[Y]) with Y of density 2 phi(y) Phi(skew y).

    So z has the mean `shift` and the standard deviation 1/(3 Cp) of `Normal` with the same `cp` and
    `shift`, whatever `skew`: 0 is the normal, +-1000 is the half-normal to 1e-6. With
    delta = skew/sqrt(1 + skew^2), E[Y] = delta sqrt(2/pi) and var[Y] = 1 - E[Y]^2. Raw moments are
    those of Y = delta |U| + sqrt(1 - delta^2) V with independent standard normals U, V.

    Reference: Azzalini (1985), A class of distributions which includes the normal ones,
    Scandinavian J. Statistics 12(2), 171-178; its mass by the function of Owen (1956).
    """

    skew: float = field(metadata={"low": -1000.0, "high": 1000.0})
    cp: float = field(default=1.0, metadata={"low": 0.0, "open_low": True})
    shift: float = field(default=0.0, metadata={"low": -1.0, "high": 1.0})

    @property
    def _delta(self) -> float:
        return self.skew / hypot(1.0, self.skew)

    @property
    def _line(self) -> tuple[float, float]:
        """(c, b) of z = c + b Y."""
        mean = self._delta * sqrt(2.0 / pi)
        scale = 1.0 / (3.0 * self.cp * sqrt(1.0 - mean**2))
        return self.shift - scale * mean, scale

    @property
    def support(self) -> tuple[float, float]:
        origin, scale = self._line
        short = TAIL / hypot(1.0, self.skew)  # the tail that phi(skew y) cuts
        low, high = (short, TAIL) if self.skew > 0.0 else (TAIL, short)
        return origin - scale * low, origin + scale * high

    def raw_moments(self, order: int) -> Array:
        k = np.arange(order + 1)

        def powers(base: float) -> Array:
            return np.asarray(base**k, dtype=float)

        half = np.array([2.0 ** (j / 2) * gamma((j + 1) / 2) / sqrt(pi) for j in k])  # E|U|^j
        even = np.where(k % 2 == 0, half, 0.0)
        centred = _of_sum(half, powers(-sqrt(2.0 / pi)))
        _, scale = self._line
        normal_scale = scale / hypot(1.0, self.skew)
        around = _of_sum(centred * powers(scale * self._delta), even * powers(normal_scale))
        return _of_sum(around, powers(self.shift))

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        origin, scale = self._line
        y, far = (z - origin) / scale, hypot(1.0, self.skew)
        peak, mean = 2.0 * density(y) * ndtr(self.skew * y), self._delta * sqrt(2.0 / pi)
        mass = np.clip(_mass(y, self.skew), 0.0, 1.0)
        first = mean * ndtr(far * y) - peak
        second = mass - y * peak - mean / far * density(far * y)
        return (
            mass,
            origin * mass + scale * first,
            origin**2 * mass + 2.0 * origin * scale * first + scale**2 * second,
        )

    def quantile(self, probability: Array) -> Array:
        origin, scale = self._line
        p = np.asarray(probability, dtype=float)
        inner = (p > OUTER) & (p < 1.0 - OUTER)
        y = np.empty_like(p)
        y[inner] = _newton(p[inner], self.skew)
        y[~inner] = scipy.stats.skewnorm.ppf(p[~inner], self.skew)
        return np.clip(origin + scale * y, *self.support)


def _newton(p: Array, skew: float) -> Array:
    """y (n,) with P(Y <= y) = p: between the nodes of a table, then by Newton's steps.

    A tenth of the time of a root search for each. The mass at y is p to 1e-15; in tails below
    `OUTER` that is too few digits.
    """
    at, mass = _table(skew)
    y = np.interp(p, mass, at)
    for _ in range(STEPS):
        y -= (_mass(y, skew) - p) / (2.0 * density(y) * ndtr(skew * y))
    return y


def _mass(y: Array, skew: float) -> Array:
    return np.asarray(ndtr(y) - 2.0 * owens_t(y, skew))


@lru_cache(maxsize=8)
def _table(skew: float) -> tuple[Array, Array]:
    """Nodes y (`NODES`,) between which p rises in its last digits, and their mass."""
    wide = np.linspace(-REACH, REACH, NODES)
    y = np.union1d(wide, wide / hypot(1.0, skew))  # there the skewed side falls off
    mass = _mass(y, skew)
    rising = (mass > 0.1 * OUTER) & (mass < 1.0 - 0.1 * OUTER)
    return y[rising], mass[rising]


def _of_sum(first: Array, second: Array) -> Array:
    """Raw moments of the sum of two independent variables from theirs, all of shape (k + 1,)."""
    return np.array([sum(comb(k, j) * first[j] * second[k - j] for j in range(k + 1)) for k in range(len(first))])
