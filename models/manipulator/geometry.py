"""Dimensions of the manipulator and of its task ring."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...errors import Fault, InputError
from ...section import Array
from ...units import MM

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


# Small vector algebra on the last axis, in batches.
#
# Vectors have their components apart in memory (the last axis is the slowest): every operation then
# runs over whole batches, several times faster than over triples.


def vector(x: Array | float, y: Array | float, z: Array | float) -> Array:
    """Vectors (..., 3) of components that broadcast."""
    return np.moveaxis(np.stack(np.broadcast_arrays(x, y, z)).astype(np.float64, copy=False), 0, -1)


def dot(a: Array, b: Array) -> Array:
    """Scalar products (...) of vectors (..., 3)."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def cross(a: Array, b: Array) -> Array:
    """Vector products (..., 3)."""
    return vector(
        a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
        a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
        a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
    )


def turned(v: Array, by: Array) -> Array:
    """exp(by) v: vectors (..., 3) turned by rotation vectors (..., 3) [rad] (Rodrigues)."""
    angle = np.sqrt(dot(by, by))[..., None]
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2  # (1 - cos)/angle^2 without cancellation
    once = cross(by, v)
    return v + first * once + second * cross(by, once)


def solved(rows: Array, right: Array) -> Array:
    """Solutions x (..., 3) of rows (..., 3, 3) . x = right (..., 3), by Cramer's rule."""
    adjugate, two, three = cofactors(rows)
    determinant = dot(rows[..., 0, :], adjugate)[..., None]
    total = right[..., 0, None] * adjugate + right[..., 1, None] * two + right[..., 2, None] * three
    return total / determinant


def cofactors(rows: Array) -> tuple[Array, Array, Array]:
    """Columns (..., 3) of the inverse of rows (..., 3, 3), times the determinant."""
    a, b, c = rows[..., 0, :], rows[..., 1, :], rows[..., 2, :]
    return cross(b, c), cross(c, a), cross(a, b)


def rotation_vector(frame: Array) -> Array:
    """Rotation vectors (..., 3) [rad] below pi, of turned unit vectors (..., 3 axes, 3)."""
    x, y, z = frame[..., 0, :], frame[..., 1, :], frame[..., 2, :]
    part = 0.5 * vector(y[..., 2] - z[..., 1], z[..., 0] - x[..., 2], x[..., 1] - y[..., 0])
    sine = np.sqrt(dot(part, part))
    cosine = 0.5 * (x[..., 0] + y[..., 1] + z[..., 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    return part * np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 1.0)[..., None]


# Closed-form inverse kinematics: joint angles and directions of the chains at a pose.


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
