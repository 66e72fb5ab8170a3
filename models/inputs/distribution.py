"""The interface of a toleranced input: input = mid + t z, with z on the scale of the zone."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Distribution(ABC):
    """Distribution of the standardised deviation z = (x - mid)/t of an input x from its mid-limit.

    z = -1 and z = +1 are the limits of the zone. Because z does not depend on the half-width t, one
    base sample and one set of moments serve every design of a batch.
    """

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
