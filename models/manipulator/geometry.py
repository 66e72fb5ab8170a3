"""Dimensions of the manipulator and of its task ring."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...arrays import Array

FollowUp = Literal["fixed", "rod"]
Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Manipulator:
    """Nominal dimensions [m]; the defaults are assumed, the document's Table 1 is lost.

    Lists hold one value per chain. `follow_up`: the plane of chain 3 is at the commanded azimuth
    ("fixed", model M1), or a rod turns it with the platform ("rod", M2).
    """

    half_length: float = 0.060  # platform attachments 1 and 2 at +-a e_t
    half_width: float = 0.045  # attachment 3 at -b e_r
    hinge_offset: float = 0.150  # hinge of chain 3 at (0, 0, h)
    arm_length: Triple = (0.400, 0.400, 0.260)
    rod_length: Triple = (0.480, 0.480, 0.420)
    joint_distance: Triple = (0.080, 0.080, 0.100)
    follow_up: FollowUp = "fixed"

    @property
    def attachments(self) -> Array:
        """Platform attachments p (3 chains, 3) [m] in platform axes."""
        a, b = self.half_length, self.half_width
        return np.array([[0.0, a, 0.0], [0.0, -a, 0.0], [-b, 0.0, 0.0]])

    @property
    def origins(self) -> Array:
        """Origins O (3 chains, 3) [m] of the arms."""
        return np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, self.hinge_offset]])

    @property
    def arms(self) -> Array:
        """Arm lengths (3,) [m]."""
        return np.array(self.arm_length)

    @property
    def rods(self) -> Array:
        """Rod lengths (3,) [m]."""
        return np.array(self.rod_length)

    @property
    def distances(self) -> Array:
        """Joint distances d (3,) [m]: between the two joints at an end of a parallelogram."""
        return np.array(self.joint_distance)


@dataclass(frozen=True, slots=True)
class TaskRing:
    """The task poses: radius and height [m] from low to high, at every azimuth."""

    r: tuple[float, float] = (0.300, 0.650)
    z: tuple[float, float] = (0.100, 0.300)
