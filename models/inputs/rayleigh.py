"""Rayleigh input: the eccentricity of a centre that is off in two directions."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from scipy.special import erf, gamma, log_ndtr, xlog1py

from ...arrays import Array
from .distribution import Distribution

REACH = 8.2
"""Largest radius in units of sigma; beyond them lies 2.5e-15 of the mass."""


@dataclass(frozen=True, slots=True)
class Rayleigh(Distribution):
    """z = radius/t >= 0, the length of a vector whose two components are normal, mean 0, std sigma.

    The tolerance t of an eccentricity (or of a runout, as half its total indicator reading) is the
    largest radius permitted, and the radius lies in [0, t]: of the zone mid +- t only mid .. mid +
    t is used, with mid, the value of a perfect part, at z = 0 and the limit at z = 1. As t shrinks
    the radius goes to 0, not to some value within [0, t]; a zone [0, 2 t] around a fixed mid would
    not do that. So an input that is not mid +- t (a full clearance) cannot have this distribution,
    and where only the component in one direction acts, that component is a `Normal`.

    `cp` is the capability against the only limit: the fraction beyond z = 1 is Phi(-3 Cp), as
    beyond either limit of a centred normal process (0.135 % at Cp = 1), which makes
    sigma = 1/sqrt(-2 ln Phi(-3 Cp)). There is no other limit, so Cpk is Cp, and there is no shift.

    Reference: Rayleigh (1880), On the resultant of a large number of vibrations of the same pitch
    and of arbitrary phase, Philosophical Magazine 10(60), 73-78.
    """

    one_sided: ClassVar[bool] = True

    cp: float = field(default=1.0, metadata={"low": 0.0, "open_low": True})

    @property
    def sigma(self) -> float:
        """Standard deviation of either component, in units of the limit."""
        return float(1.0 / np.sqrt(-2.0 * log_ndtr(-3.0 * self.cp)))

    @property
    def support(self) -> tuple[float, float]:
        return 0.0, REACH * self.sigma

    def raw_moments(self, order: int) -> Array:
        k = np.arange(order + 1)
        return np.asarray((np.sqrt(2.0) * self.sigma) ** k * gamma(1.0 + 0.5 * k))

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        sigma = self.sigma
        u = np.maximum(z, 0.0)
        power = -0.5 * (u / sigma) ** 2
        mass, beyond = -np.expm1(power), np.exp(power)
        first = sigma * np.sqrt(0.5 * np.pi) * erf(u / (np.sqrt(2.0) * sigma)) - u * beyond
        return mass, first, 2.0 * sigma**2 * mass - u**2 * beyond

    def quantile(self, probability: Array) -> Array:
        radius = np.sqrt(-2.0 * xlog1py(1.0, -probability))
        return np.asarray(self.sigma * np.minimum(radius, REACH))
