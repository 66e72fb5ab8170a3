"""A robot as links and drives: joint errors, the pose errors they make, and measures of a sample."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import ndtri

from ..section import Array
from .manipulator import maps as sources
from .manipulator.forward import split
from .manipulator.geometry import Manipulator
from .manipulator.maps import first_order

GRAVITY = 9.80665
"""Standard gravity [m/s^2]."""


# Maps from joint errors of any machine to its tool, by pose.


POSE_COORDINATES = 6
"""Least number of joints with which position and orientation can both be kept."""
RELATIVE_RATE_TOLERANCE = 1e-9
"""Rate of a joint, over the largest, below which it is rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Drives:
    """First-order maps of joints at poses (n,) with the weights (n,) of a mean (sum 1).

    `move` (n, 3, joints) [m/rad] of the position and `turn` (n, 3, joints) [rad/rad] of the
    orientation: about two axes of the tool's tilt and that of its yaw.
    """

    weight: Array
    move: Array
    turn: Array

    def mean(self, values: Array) -> Array:
        """Weighted mean over the poses (first axis)."""
        return np.asarray(np.tensordot(self.weight, values, axes=(0, 0)))

    @property
    def squares(self) -> Array:
        """Squared displacement (n, joints) [(m/rad)^2]."""
        return np.asarray(np.sum(self.move**2, axis=1))

    def approach_sides(self, directions: Array) -> Array:
        """Signs (approaches, n, joints) of the joints' motion towards `directions` (k, 3).

        With six joints or more the orientation is kept; with fewer they move the position alone,
        with the least motion of all joints. 0 for a joint that does not move.
        """
        whole = self.move.shape[2] >= POSE_COORDINATES
        rows = np.concatenate([self.move, self.turn], axis=1) if whole else self.move
        rate = np.einsum("nji,ki->knj", np.linalg.pinv(rows)[:, :, :3], directions)
        return np.where(np.abs(rate) > RELATIVE_RATE_TOLERANCE * np.abs(rate).max(), np.sign(rate), 0.0)

    def variation(self, reversing: Array, directions: Array | None = None, free: Array | None = None) -> Array:
        """Squared vAP (n,) [m^2] of reversals `reversing` (joints,) [rad]: their root mean squares.

        `directions` (k, 3) are those of the approaches, three orthogonal ones by default; `free`
        (n, joints) is 0 where gravity holds a flank. Joints whose reversals are 0 have none.
        """
        towards = np.eye(3) if directions is None else directions
        sides = self.approach_sides(towards)
        size = reversing if free is None else reversing * free
        apart = [
            np.sum(np.einsum("nij,nj->ni", self.move, 0.5 * (sides[a] - sides[b]) * size) ** 2, axis=1)
            for a, b in combinations(range(len(sides)), 2)
        ]
        return np.asarray(np.max(apart, axis=0))


# The parallel manipulator of document M as a machine with reducers on its drives.


CALIBRATED = ("none", "position")
DRIVES = tuple(f"drive_zero_{chain}_mrad" for chain in (1, 2, 3))
AT = [sources.NAMES.index(name) for name in DRIVES]
ORDER = 24


@dataclass(frozen=True, slots=True, eq=False)
class LinkMaps:
    """Maps of the 63 sources at poses (n,) [m/m, m/rad; rad/m, rad/rad]: (n, 3, 63) each.

    Where positions are calibrated, commands are corrected for the machine's own links until its
    position is exact: `move` is 0 and `turn` the residual.
    """

    move: Array
    turn: Array


def drives(manipulator: Manipulator, r: Array, z: Array, weight: Array) -> Drives:
    """The maps of the three drives at poses r, z (n,) [m]. Raises OutOfReach."""
    maps = first_order(manipulator, r, z)
    return Drives(weight, maps.position[:, :, AT], maps.orientation[:, :, AT])


def links(manipulator: Manipulator, r: Array, z: Array, calibrated: str = "none") -> LinkMaps:
    """The maps of the links' sources at poses r, z (n,) [m]. Raises OutOfReach."""
    if calibrated == "position":
        residual = split(manipulator, r, z).residual
        return LinkMaps(np.zeros_like(residual), residual)
    maps = first_order(manipulator, r, z)
    return LinkMaps(maps.position, maps.orientation)


def gravity_torque(machine: Drives, payload: float) -> Array:
    """Torque (n, joints) [N m] of a payload [kg] at the platform: m g dz/dtheta (virtual work).

    The platform hangs on inclined rods, so that arms which turn in a plane lift it as well.
    """
    return np.asarray(payload * GRAVITY * machine.move[:, 2, :])


# Accuracy of attained positions: the measures of ISO 9283, and their bidirectional extension.
#
# ISO 9283:1998 (quoted after secondary sources) defines the pose accuracy AP, the distance from the
# command to the mean attained from one approach; the repeatability RP; the multi-directional
# variation vAP of three approaches; path accuracy AT. Repeatability, the figure of data sheets, does
# not depend on tolerances. The bidirectional pose accuracy is the quantile of the
# error over units, sides of approach, phases of waves, and poses.


COVERAGE = 0.9973


def bidirectional(errors: Array, coverage: float = COVERAGE) -> tuple[float, float]:
    """A and R of errors (n, 3): the quantile of their length at the coverage, and its rms."""
    length = np.linalg.norm(errors, axis=-1)
    quantile = np.quantile(length, coverage, method="weibull")
    return float(quantile), float(np.sqrt(np.mean(length**2)))


# Bidirectional pose accuracy of a design by Monte Carlo: its quantile over its rms.
#
# One sample serves all designs. Units are drawn anew at every pose, since the quantile is taken over
# units and poses together; the links' errors at a pose are jointly normal.


POSES = 512
PER_JOINT = 4
"""Dimensions of a joint in addition to its backlash: side, phase, two components of the wave."""


@dataclass(frozen=True, slots=True, eq=False)
class AccuracySample:
    """Units (n,) at poses: `pose` (n,) is the index of the pose in the maps.

    `link` (n, 3) are standard normal, `side` (n, joints) is +1 or -1, `wave` (2, 2, n, joints) the
    cosine and sine of the phase times two standard normal components, `unit` (n, dimensions) in
    (0, 1) is for the reducers' errors.
    """

    pose: NDArray[np.int64]
    link: Array
    side: Array
    wave: Array
    unit: Array

    @classmethod
    def draw(cls, samples: int, poses: int, joints: int, dimensions: int, rng: np.random.Generator) -> AccuracySample:
        """A scrambled Sobol sample, rounded up to a power of two, over `poses` in turn."""
        bits = int(np.ceil(np.log2(max(samples, 2 * poses))))
        points = scipy.stats.qmc.Sobol(3 + PER_JOINT * joints + dimensions, rng=rng).random_base2(bits)
        points = np.clip(points, 1e-12, 1.0 - 1e-12)
        count, n = 3, len(points)
        side = np.where(points[:, count : count + joints] < 0.5, -1.0, 1.0)
        phase = 2.0 * np.pi * points[:, count + joints : count + 2 * joints]
        normal = ndtri(points[:, count + 2 * joints : count + 4 * joints]).reshape(n, joints, 2)
        waves = [[turn * normal[:, :, at] for at in range(2)] for turn in (np.cos(phase), np.sin(phase))]
        return cls(np.arange(n) % poses, ndtri(points[:, :3]), side, np.array(waves), points[:, count + 4 * joints :])

    def joint_errors(self, backlash: Array, wave_root: Array, free: Array) -> Array:
        """q (n, joints) [rad] of units.

        `backlash` (n, joints) with the hysteresis, `wave_root` (joints, 2, 2) a root of the
        covariance of the wave's components [rad], `free` (n, joints) 0 where a flank is held.
        """
        errors = 0.5 * self.side * backlash * free
        for a, b in product(range(2), repeat=2):
            errors += wave_root[:, a, b] * self.wave[a, b]
        return np.asarray(errors)

    def errors(self, drives: Drives, covariance: Array, joint: Array) -> Array:
        """Position errors (n, 3) [m] by the first-order maps.

        `covariance` (poses, 3, 3) [m^2] of the links' position error, `joint` (n, joints) [rad].
        """
        by_links = np.einsum("nij,nj->ni", smooth_root(covariance)[self.pose], self.link)
        return np.asarray(by_links + np.einsum("nij,nj->ni", drives.move[self.pose], joint))


def smooth_root(covariance: Array) -> Array:
    """A with A A' = covariance (..., k, k), lower triangular: it is smooth in the covariance,
    so that similar designs have similar samples. Singular covariances are widened by 1e-12.
    """
    size = np.trace(covariance, axis1=-2, axis2=-1)[..., None, None] * 1e-12 + 1e-60
    return np.linalg.cholesky(covariance + size * np.eye(covariance.shape[-1]))


def ratio(errors: Array, coverage: float = COVERAGE) -> float:
    """c = A/R of errors (n, 3): quantile over rms of their lengths; 1 where all are 0."""
    square = np.sum(errors**2, axis=1)
    rms = float(np.sqrt(square.mean()))
    return float(np.sqrt(np.quantile(square, coverage, method="weibull"))) / rms if rms else 1.0


def sobol_poses(low: tuple[float, ...], high: tuple[float, ...], rng: np.random.Generator, count: int = POSES) -> Array:
    """Poses (count, k) spread evenly between `low` and `high` (k,)."""
    points = scipy.stats.qmc.Sobol(len(low), rng=rng).random_base2(int(np.ceil(np.log2(count))))
    return np.asarray(np.array(low) + points * (np.array(high) - np.array(low)))
