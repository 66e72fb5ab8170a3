"""Uniform input: every value of the zone is equally likely."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .distribution import WithinZone


@dataclass(frozen=True, slots=True)
class Uniform(WithinZone):
    """z uniform on [-1, 1]: variance t^2/3. It fills the zone, so it has no Cp and no shift."""

    def raw_moments(self, order: int) -> Array:
        k = np.arange(order + 1)
        return np.where(k % 2 == 0, 1.0 / (k + 1.0), 0.0)

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        u = np.clip(z, -1.0, 1.0)
        square = u * u
        return 0.5 * (u + 1.0), 0.25 * (square - 1.0), (square * u + 1.0) / 6.0

    def quantile(self, probability: Array) -> Array:
        return 2.0 * probability - 1.0
