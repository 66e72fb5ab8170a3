"""Backlash of the involute stage, from the deviations of its gears."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin, sqrt

import numpy as np

from ...arrays import Array
from .geometry import RvGeometry

REFERENCE_GRADE = 7
"""ISO grade of the default deviations; they grow by sqrt(2) per grade."""


@dataclass(frozen=True, slots=True)
class InvoluteStage:
    """Deviations of sun and planet at grade 7 [m]; all defaults are assumptions.

    `thickness_upper` and `thickness_lower` are the magnitudes of the deviations E_ss and E_si of
    the base tangent length, the same for both gears.
    """

    pressure_angle: float = radians(20.0)
    runout: float = 36e-6
    base_pitch: float = 13e-6
    helix: float = 11e-6
    parallelism_x: float = 11e-6
    parallelism_y: float = 5.5e-6
    centre_distance: float = 19.5e-6
    thickness_upper: float = 56e-6
    thickness_lower: float = 112e-6
    cosine: bool = True
    """Whether j_n, which is normal to the flanks, is divided by cos(alpha)."""

    @property
    def compensation(self) -> float:
        """Delta: reduction of the smallest clearance by gear errors [m]."""
        s, c = sin(self.pressure_angle), cos(self.pressure_angle)
        return sqrt(
            (2.0 * self.centre_distance * s) ** 2
            + 2.0 * self.helix**2
            + 2.0 * self.base_pitch**2
            + (self.parallelism_x * s) ** 2
            + (self.parallelism_y * c) ** 2
        )

    def flank_clearance(self) -> tuple[float, float]:
        """j_nmin and j_nmax [m] at grade 7, as document B prints them."""
        s, c = sin(self.pressure_angle), cos(self.pressure_angle)
        runout = 0.72 * 2.0 * self.runout
        least = 2.0 * self.thickness_upper * c - self.compensation
        least += 1.44 * (self.centre_distance - runout) * s
        most = 2.0 * self.thickness_lower * c + 1.44 * (self.centre_distance + runout) * s
        return least, most


def grade_factor(grade: Array) -> Array:
    """sqrt(2)^(grade - 7), the growth of gear deviations with the ISO grade (ISO 1328-1)."""
    return np.asarray(np.sqrt(2.0) ** (grade - REFERENCE_GRADE))


def lever(stage: InvoluteStage, geometry: RvGeometry) -> float:
    """j_n/phi_1 [m]: i r_1 cos(alpha), as document B prints it i r_1."""
    pitch = geometry.reduction_ratio * geometry.sun_pitch_radius
    return pitch * cos(stage.pressure_angle) if stage.cosine else pitch


def backlash_zone(stage: InvoluteStage, geometry: RvGeometry, grade: Array) -> tuple[Array, Array]:
    """Mid value and half-width [rad] of phi_1 of one planet, each of the shape of `grade`."""
    least, most = stage.flank_clearance()
    unit = grade_factor(grade) / lever(stage, geometry)
    return 0.5 * (most + least) * unit, 0.5 * (most - least) * unit
