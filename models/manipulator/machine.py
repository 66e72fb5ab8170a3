"""Joints of machines whose parts have errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from . import sources
from .geometry import Manipulator
from .inverse import CHAINS, SIDE, axes
from .vectors import turned, vector

SIDES = np.array([0.5, -0.5])
"""s_j/2 of the two rods of a parallelogram."""
UP = np.array([0.0, 0.0, 1.0])
JOINT_LINES = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
"""n of the chains in platform axes."""


@dataclass(frozen=True, slots=True)
class Machine:
    """Joints of machines (...) [m], in the meridian plane's axes: three chains of two rods.

    `base` (..., 3, 3) where the arms begin, `arm` (..., 3, 2, 3) from there to the joints with the
    follow-up plane at 0, `arm_middle` (..., 3) of chain 3 likewise, `platform` (..., 3, 2, 3) in
    platform axes, its `middle` (..., 3) of chain 3, and the rods' `length` (..., 3, 2).
    """

    base: Array
    arm: Array
    arm_middle: Array
    platform: Array
    middle: Array
    length: Array


def built(manipulator: Manipulator, drives: Array, phi: Array, errors: Array) -> Machine:
    """Machines with `errors` (..., 63) [m, rad], their arms commanded to `drives` (..., 3)
    [rad] from e_r at the azimuth `phi` (...) [rad].

    A_ij = O + dO + F exp(dT) ((l1 + dl1) x + s_j (d + ddA)/2 exp(dA) n) and
    B_ij = P + R (p + dp + s_j (d + ddB)/2 exp(dB) n), |B_ij - A_ij| = l2 + dl2_ij.
    """
    m, e = manipulator, _by_chain(errors)
    middle = vector(m.arms + e[..., sources.ARM_LENGTH], 0.0, 0.0)
    line = turned(SIDE[:, None] * UP, e[..., sources.JOINT_LINE_ARM])
    joints = _pair(middle, line, m.distances + e[..., sources.JOINT_DISTANCE_ARM])
    joints = turned(joints, e[..., sources.ARM_ORIENTATION][..., None, :])
    u, v, k = (a[..., None, :] for a in axes(drives + e[..., sources.DRIVE_ZERO]))
    arm = joints[..., :1] * u + joints[..., 1:2] * v + joints[..., 2:] * k
    across = turned(JOINT_LINES, e[..., sources.JOINT_LINE_PLATFORM])
    at = m.attachments + e[..., sources.PLATFORM_ATTACHMENT]
    return Machine(
        base=m.origins + about_up(e[..., sources.ORIGIN], -phi[..., None]),
        arm=arm,
        arm_middle=arm[..., 2, :, :].mean(axis=-2),
        platform=_pair(at, across, m.distances + e[..., sources.JOINT_DISTANCE_PLATFORM]),
        middle=at[..., 2, :],
        length=m.rods[:, None] + e[..., sources.ROD_LENGTH],
    )


def about_up(v: Array, angle: Array) -> Array:
    """Vectors (..., 3) turned about z by angles (...) [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return vector(c * v[..., 0] - s * v[..., 1], s * v[..., 0] + c * v[..., 1], v[..., 2])


def _by_chain(errors: Array) -> Array:
    """Errors (..., 63) as (..., 3 chains, 21), the sources apart in memory."""
    apart = np.ascontiguousarray(np.moveaxis(errors, -1, 0))
    apart = apart.reshape(CHAINS, sources.PER_CHAIN, *apart.shape[1:])
    return np.moveaxis(apart, (0, 1), (-2, -1))


def _pair(middle: Array, line: Array, distance: Array) -> Array:
    """The two joints (..., 3, 2, 3) on a joint line (..., 3, 3) about its middle (..., 3, 3)."""
    half = SIDES * distance[..., None]
    return middle[..., None, :] + half[..., None] * line[..., None, :]
