"""Places of features: points in the disc of a diametral zone, by the pieces of a mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...section import Array
from ..inputs import Beta, Distribution, Normal, Uniform

PLANE = ("uniform_disc", "uniform_circle", "normal")
"""Laws of a place in two directions: anywhere in its zone alike, at its edge in any direction alike,
or each component normal with the radius of the zone as 3 Cp standard deviations.
"""


def component(law: str, cp: float = 1.0) -> Distribution:
    """The distribution of one component z of a place in a zone of radius 1, or half-width 1.

    The density of a component is in proportion to sqrt(1 - z^2) where the place is uniform in the disc,
    and to 1/sqrt(1 - z^2) where it is on the circle. `cp` is for "normal" alone.
    """
    match law:
        case "uniform_disc":
            return Beta(1.5, 1.5)
        case "uniform_circle":
            return Beta(0.5, 0.5)
        case "uniform":
            return Uniform()
    return Normal(cp)


@dataclass(frozen=True, slots=True)
class Disc:
    """Two pieces of a mechanism that are the components of one place (z_i, z_j), |z| <= 1.

    The `law`, one of `PLANE`, is alike in all directions, so that S_i z_i + S_j z_j is distributed as
    sqrt(S_i^2 + S_j^2) z_i.
    """

    pieces: tuple[int, int]
    law: str

    @property
    def dependent(self) -> bool:
        """Whether one component restricts the other; normal ones are independent."""
        return self.law != "normal"

    def named(self, names: Sequence[str]) -> list[str]:
        """Its components by name."""
        return [names[piece] for piece in self.pieces]

    def turned(self, slopes: Array) -> Array:
        """Slopes (k,) by the pieces with those of this place replaced by their length, and 0."""
        along, across = self.pieces
        turned = slopes.copy()
        turned[along], turned[across] = np.hypot(slopes[along], slopes[across]), 0.0
        return turned

    def drawn(self, along: Array, around: Array) -> tuple[Array, Array]:
        """Components z from two uniform numbers (m,) each, of a dependent law."""
        radius = np.sqrt(along) if self.law == "uniform_disc" else np.ones_like(along)
        return radius * np.cos(2.0 * np.pi * around), radius * np.sin(2.0 * np.pi * around)

    def rounded(self, points: Array, used: Sequence[int], slopes: Array) -> Array:
        """Points (len(used), m) of the square of both components moved into the disc, along rays.

        Corners go to its edge; (1, 1) to where slopes (k,) say that the requirement is largest.
        """
        if not set(self.pieces) <= set(used):
            return points
        rows = [used.index(piece) for piece in self.pieces]
        x, y = points[rows]
        radius = np.maximum(np.abs(x), np.abs(y))
        angle = np.arctan2(y, x) - 0.25 * np.pi + np.arctan2(*slopes[list(self.pieces[::-1])])
        moved = points.copy()
        moved[rows] = radius * np.cos(angle), radius * np.sin(angle)
        return moved
