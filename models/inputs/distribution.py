"""The interface of a toleranced input: input = mid + t z, with z in units of the half-width."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import Field, fields
from typing import Any, ClassVar

import numpy as np

from ...arrays import Array
from ...section import Range

GRAIN = 1e-4
"""Half-width [z] of an average that leaves a law with a bounded density as it is, within 1e-9."""
COARSE = 0.05
"""The same of a law with atoms or poles, in its standard deviations: its variance grows by 0.08 %."""


def allowed(parameter: Field[Any]) -> Range:
    """The range that a parameter declares in its metadata: low, high, open_low, open_high."""
    return Range(**parameter.metadata)


class Distribution(ABC):
    """Distribution of the standardised deviation z = (x - mid)/t of an input x from its mid-limit.

    z = -1 and z = +1 are the limits of the zone. Because z does not depend on the half-width t, one
    base sample and one set of moments serve every design of a batch. A distribution is a frozen
    dataclass whose fields are its parameters; the metadata of a field states the numbers allowed.
    """

    one_sided: ClassVar[bool] = False
    """Whether z is a radius: never below 0, so that only mid .. mid + t of the zone is used."""

    @property
    @abstractmethod
    def support(self) -> tuple[float, float]:
        """Interval of z outside of which the mass is below 1e-14."""

    @abstractmethod
    def raw_moments(self, order: int) -> Array:
        """E[z^k] for k = 0 .. order, shape (order + 1,)."""

    @abstractmethod
    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        """E[u^k; u <= z] for k = 0, 1, 2, each of the shape of z."""

    @abstractmethod
    def quantile(self, probability: Array) -> Array:
        """The z below which `probability` of the units lie, same shape."""

    @property
    def grain(self) -> float:
        """Half-width [z] over which `averaged` averages this law."""
        return GRAIN

    def averaged(self, z: Array) -> tuple[Array, Array]:
        """P(Z + e <= z) and its derivative, both of the shape of `z`, e uniform on +-`grain`.

        The probability has a derivative for every law, with atoms and poles too, and both agree
        exactly: with G the integral of the distribution function F, G(z) = z F(z) - E[Z; Z <= z],
        they are the differences of G and F over 2 `grain`.
        """
        width, (first, last) = 2.0 * self.grain, self.support
        middle = np.clip(z, first - width, last + width)
        low, high = middle - self.grain, middle + self.grain
        (below, before, _), (above, beyond, _) = self.partial_moments(low), self.partial_moments(high)
        return (high * above - beyond - (low * below - before)) / width, (above - below) / width

    def faults(self) -> list[tuple[str, str]]:
        """(parameter, message) for every parameter that is outside of its range."""
        return [
            (parameter.name, complaint)
            for parameter in fields(self)  # type: ignore[arg-type]
            for value in np.atleast_1d(getattr(self, parameter.name))
            if (complaint := allowed(parameter).complaint(float(value)))
        ]


def coarse(law: Distribution) -> float:
    """The `grain` of a law with atoms or poles."""
    _, first, second = law.raw_moments(2)
    return COARSE * float(np.sqrt(second - first**2))


class WithinZone(Distribution):
    """A distribution without mass beyond the limits of the zone."""

    @property
    def support(self) -> tuple[float, float]:
        return -1.0, 1.0
