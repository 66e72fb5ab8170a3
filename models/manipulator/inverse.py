"""Closed-form inverse kinematics: joint angles and directions of the chains at a pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from ...errors import Fault, InputError
from ...units import MM
from .geometry import Manipulator
from .vectors import vector

CHAINS = 3
SIDE = np.array([1.0, 1.0, -1.0])
"""n = SIDE k: the joint lines of chains 1 and 2 are the axes of their arms, that of chain 3 is
e_t, against its axis."""


class OutOfReach(InputError):
    """A pose that a chain does not reach."""


@dataclass(frozen=True, slots=True)
class Posture:
    """The chains at poses (...), in the axes (e_r, e_t, z) of the meridian plane.

    `angle` (..., 3) [rad] of the arms from e_r; unit vectors (..., 3 chains, 3): `w` along the rods
    from arm to platform, `n` along the joint line, `u` along the arm, `v` where it goes when its
    angle grows, `k` = u x v its axis; `p` (..., 3, 3) [m] the platform attachments.
    """

    angle: Array
    w: Array
    n: Array
    u: Array
    v: Array
    k: Array
    p: Array


def reach(manipulator: Manipulator, r: Array, z: Array) -> Array:
    """Cosine (..., 3) of the angle between each arm and the line to its attachment.

    For chains 1 and 2 in plan, for chain 3 in the meridian plane. A chain reaches the pose where it
    lies in [-1, 1].
    """
    m = manipulator
    rho = np.hypot(r, m.half_length)
    q = np.hypot(r - m.half_width, z - m.hinge_offset)
    squares = [rho**2 + z**2, rho**2 + z**2, q**2]
    distances = [rho, rho, q]
    with np.errstate(divide="ignore", invalid="ignore"):
        cosines = [
            (squares[i] + m.arm_length[i] ** 2 - m.rod_length[i] ** 2) / (2.0 * distances[i] * m.arm_length[i])
            for i in range(CHAINS)
        ]
    return np.stack(cosines, axis=-1)


def angles(manipulator: Manipulator, r: Array, z: Array) -> Array:
    """Angles (..., 3) [rad] of the arms from e_r, at poses r, z (...) [m].

    The drives of chains 1 and 2 are at phi plus these angles. Raises OutOfReach.
    """
    r, z = np.broadcast_arrays(np.asarray(r, dtype=float), np.asarray(z, dtype=float))
    cosine = reach(manipulator, r, z)
    _refuse_out_of_reach(cosine, r, z)
    bend = np.arccos(cosine)
    side = np.arctan2(manipulator.half_length, r)
    rise = np.arctan2(z - manipulator.hinge_offset, r - manipulator.half_width)
    return np.stack([side + bend[..., 0], -side - bend[..., 1], rise + bend[..., 2]], axis=-1)


def posture(manipulator: Manipulator, r: Array, z: Array) -> Posture:
    """The chains at poses r, z (...) [m]. Raises OutOfReach."""
    m = manipulator
    r, z = np.broadcast_arrays(np.asarray(r, dtype=float), np.asarray(z, dtype=float))
    angle = angles(m, r, z)
    u, v, k = axes(angle)
    p = np.broadcast_to(m.attachments, u.shape)
    ends = vector(r, 0.0, z)[..., None, :] + p
    w = (ends - m.origins - m.arms[:, None] * u) / m.rods[:, None]
    return Posture(angle, w, SIDE[:, None] * k, u, v, k, p)


def axes(angle: Array) -> tuple[Array, Array, Array]:
    """Arm axes u, v, k (..., 3 chains, 3) at arm angles (..., 3) [rad] from e_r."""
    c, s, zero = np.cos(angle), np.sin(angle), np.zeros_like(angle)
    upright = np.array([0.0, 0.0, 1.0])  # 1 for the chain whose arm moves in the meridian plane
    flat = 1.0 - upright
    u = np.stack([c, s * flat, s * upright], axis=-1)
    v = np.stack([-s, c * flat, c * upright], axis=-1)
    k = np.stack([zero, zero - upright, zero + flat], axis=-1)
    return u, v, k


def _refuse_out_of_reach(cosine: Array, r: Array, z: Array) -> None:
    bad = ~(np.abs(cosine) <= 1.0)
    if not bad.any():
        return
    faults = []
    for chain in np.flatnonzero(bad.reshape(-1, CHAINS).any(axis=0)):
        at = int(np.flatnonzero(bad[..., chain])[0])
        pose = f"r = {r.flat[at] / MM:.6g} mm, z = {z.flat[at] / MM:.6g} mm"
        count = int(bad[..., chain].sum())
        faults.append(
            Fault(
                f"pose {at + 1} ({pose})",
                f"is out of reach of chain {chain + 1} ({count} of {r.size} poses are out of its reach): the cosine"
                f" of its arm's angle would be {cosine[..., chain].flat[at]:.6g}",
            )
        )
    raise OutOfReach(faults)
