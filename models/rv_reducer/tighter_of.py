"""The tighter of several planets whose clearances have any distribution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from ..inputs import Uniform
from ..inputs.distribution import Distribution
from .tighter_planet import TighterPlanet, partial_moments, raw_moments


@dataclass(frozen=True, slots=True)
class TighterOf(Distribution):
    """z = min_k Q(u_k), Q the quantiles of the clearance of each `planet`, u_k uniform on [0, 1].

    Q rises, so that z = Q(min_k u_k), and 2 min_k u_k - 1 has the law `tighter`.
    """

    planet: Distribution
    tighter: TighterPlanet

    @property
    def support(self) -> tuple[float, float]:
        return self.planet.support

    @property
    def grain(self) -> float:
        return self.planet.grain

    def faults(self) -> list[tuple[str, str]]:
        return [*self.planet.faults(), *self.tighter.faults()]

    def raw_moments(self, order: int) -> Array:
        return np.array(raw_moments(self.tighter, self.planet, order))

    def partial_moments(self, z: Array) -> tuple[Array, Array, Array]:
        below = self.planet.partial_moments(np.asarray(z, dtype=float))[0]
        return partial_moments(self.tighter, self.planet, 2.0 * below - 1.0)

    def quantile(self, probability: Array) -> Array:
        return self.planet.quantile(0.5 * (1.0 + self.tighter.quantile(probability)))


def tighter_of(planet: Distribution, tighter: TighterPlanet) -> Distribution:
    """The law of the least clearance; that of a single planet where all clearances are equal."""
    if tighter.is_single:
        return planet
    return tighter if planet == Uniform() else TighterOf(planet, tighter)
