"""First-order maps of the elementary errors to the pose, orientation and position apart.

With w along a rod, n along a joint line, d the joint distance and p the attachment, the difference
of the two closures of a parallelogram gives the orientation,

    (n x w).dth = (dl2_a - dl2_b)/d - (ddB - ddA)/d (w.n) + (n x w).(dT + dA - dB),

and half their sum the position,

    w.dP + (p x w).dth = (dl2_a + dl2_b)/2 - w.dp + w.dO
                         + (l1 u x w).dT + (w.u) dl1 + l1 (w.v) dth0.

In model M2 the follow-up plane also turns by dpsi: dth_z grows by it, and it solves
(B3 - A3).e_t = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from . import sources
from .geometry import Manipulator
from .inverse import CHAINS, Posture, posture
from .vectors import cross, dot


@dataclass(frozen=True, slots=True)
class Maps:
    """Pose errors per metre or radian of each source, at poses (n,).

    `orientation` (n, 3, 63): dth_r, dth_t, dth_z; `position` (n, 3, 63): dr, dt, dz; `follow_up`
    (n, 63): dpsi, zero in model M1. Axes (e_r, e_t, z) of each pose, sources as in `SOURCES`.
    """

    orientation: Array
    position: Array
    follow_up: Array


def first_order(manipulator: Manipulator, r: Array, z: Array, phi: Array | float = 0.0) -> Maps:
    """The maps of all 63 sources at poses r, z [m], phi [rad], each (n,) or a number.

    The azimuth matters only to the sources fixed in the base (origins). Raises OutOfReach.
    """
    r, z, phi = (np.asarray(coordinate, dtype=float).ravel() for coordinate in (r, z, phi))
    r, z = np.broadcast_arrays(r, z)
    chains = posture(manipulator, r, z)
    turn, place, shift = separated(chains)
    by_turn = turn[..., None] * differences(manipulator, chains)[:, None]  # (n, 3, chain, 21)
    by_place = place[..., None] * half_sums(manipulator, chains, phi)[:, None]
    orientation = by_turn.reshape(len(r), 3, -1)
    position = by_place.reshape(len(r), 3, -1)
    position += shift @ orientation
    if manipulator.follow_up == "fixed":
        return Maps(orientation, position, np.zeros((len(r), orientation.shape[-1])))
    gap = _gap_along_e_t(manipulator, chains, phi)
    plane = position[:, 1] - manipulator.half_width * orientation[:, 2] - gap
    plane /= (r - shift[:, 1, 2])[:, None]
    orientation[:, 2] += plane
    position += shift[:, :, 2, None] * plane[:, None]
    return Maps(orientation, position, plane)


def separated(chains: Posture) -> tuple[Array, Array, Array]:
    """Matrices (n, 3, 3) of the separated equations, solved.

    They map the differences of the closures to the orientation, their half sums to the position,
    and the orientation to the position.
    """
    across, lever = cross(chains.n, chains.w), cross(chains.p, chains.w)
    turn = np.linalg.inv(across).astype(np.float64, copy=False)
    place = np.linalg.inv(chains.w).astype(np.float64, copy=False)
    return turn, place, -place @ lever


def differences(manipulator: Manipulator, chains: Posture) -> Array:
    """Right-hand sides (n, 3 chains, 21) of the orientation equations."""
    n, w, d = chains.n, chains.w, manipulator.distances
    across = cross(n, w)
    on_arm = np.stack([dot(across, axis) for axis in (chains.u, chains.v, chains.k)], axis=-1)
    slant = dot(w, n) / d
    columns = np.zeros((*slant.shape, sources.PER_CHAIN))
    columns[..., sources.ARM_ORIENTATION] = on_arm
    columns[..., sources.DRIVE_ZERO] = on_arm[..., 2]
    columns[..., sources.JOINT_LINE_ARM] = on_arm
    columns[..., sources.JOINT_DISTANCE_ARM] = slant
    columns[..., sources.ROD_LENGTH] = np.array([1.0, -1.0]) / d[:, None]
    columns[..., sources.JOINT_LINE_PLATFORM] = -across
    columns[..., sources.JOINT_DISTANCE_PLATFORM] = -slant
    return columns


def half_sums(manipulator: Manipulator, chains: Posture, phi: Array) -> Array:
    """Right-hand sides (n, 3 chains, 21) of the position equations."""
    w, arm = chains.w, manipulator.arms
    c, s = np.cos(phi)[:, None], np.sin(phi)[:, None]
    along_v = arm * dot(w, chains.v)
    columns = np.zeros((*along_v.shape, sources.PER_CHAIN))
    x, y = c * w[..., 0] - s * w[..., 1], s * w[..., 0] + c * w[..., 1]
    columns[..., sources.ORIGIN] = np.stack([x, y, w[..., 2]], axis=-1)
    columns[..., sources.ARM_LENGTH] = dot(w, chains.u)
    lever = [np.zeros_like(along_v), -arm * dot(w, chains.k), along_v]  # l1 u x w on u, v, k
    columns[..., sources.ARM_ORIENTATION] = np.stack(lever, axis=-1)
    columns[..., sources.DRIVE_ZERO] = along_v
    columns[..., sources.ROD_LENGTH] = 0.5
    columns[..., sources.PLATFORM_ATTACHMENT] = -w
    return columns


def _gap_along_e_t(manipulator: Manipulator, chains: Posture, phi: Array) -> Array:
    """Displacement (n, 63) of A3 - B3 along e_t by the sources themselves."""
    columns = np.zeros((len(chains.w), CHAINS, sources.PER_CHAIN))
    last = columns[:, 2]
    last[:, sources.ORIGIN.start] = -np.sin(phi)
    last[:, sources.ORIGIN.start + 1] = np.cos(phi)
    e_t = -chains.k[:, 2]
    arm = manipulator.arm_length[2]
    turned = np.stack([cross(axis[:, 2], chains.u[:, 2]) for axis in (chains.u, chains.v, chains.k)], axis=1)
    last[:, sources.ARM_ORIENTATION] = arm * np.einsum("nia,na->ni", turned, e_t)
    last[:, sources.PLATFORM_ATTACHMENT.start + 1] = -1.0
    return columns.reshape(len(columns), -1)
