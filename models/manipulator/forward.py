"""Exact pose of a manipulator with any elementary errors, by Newton's method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import Fault, InputError
from ..inputs.distribution import Array
from . import sources
from .geometry import Manipulator
from .inverse import CHAINS, SIDE, angles, axes
from .vectors import cross, dot, rotation_matrix, rotation_vector, turned, vector

ENOUGH = 1e-9
"""Newton's last step [m, rad]: it squares, so that what is left is rounding."""
MOST_STEPS = 20
SIDES = np.array([0.5, -0.5])
"""s_j/2 of the two rods of a parallelogram."""
UP = np.array([0.0, 0.0, 1.0])


class NoPose(InputError):
    """Errors or a start with which Newton's method finds no pose."""


@dataclass(frozen=True, slots=True)
class PoseError:
    """What a pose (...) is off, in the axes (e_r, e_t, z) at its azimuth.

    `position` (..., 3) [m]: dr, dt, dz; `orientation` (..., 3) [rad]: the rotation vector (two
    tilts, whose length is the squareness, and the yaw); `follow_up` (...) [rad]: how far the
    follow-up plane is turned (0 in model M1); `steps` that Newton's method took.
    """

    position: Array
    orientation: Array
    follow_up: Array
    steps: int


@dataclass(frozen=True, slots=True)
class _Machine:
    """Joints of the machines (...), six in all: three chains of two rods.

    `base` (..., 3, 3) where the arms begin, `arm` (..., 3, 2, 3) from there to the joints with the
    follow-up plane at 0, `arm_middle` (..., 3) of chain 3 likewise, `platform` (..., 3, 2, 3) in
    platform axes, its `middle` (..., 3) of chain 3, and the rods' `length` (..., 6).
    """

    base: Array
    arm: Array
    arm_middle: Array
    platform: Array
    middle: Array
    length: Array


def exact_pose(
    manipulator: Manipulator,
    r: Array,
    z: Array,
    phi: Array | float = 0.0,
    errors: Array | None = None,
) -> PoseError:
    """The pose that the drives reach when they are told the nominal angles of r, z [m], phi [rad].

    `errors` (..., 63) [m, rad] in the order of `sources.SOURCES`; poses (...) and errors broadcast:
    r[:, None] with errors (m, 63) gives every pose of every machine. Raises OutOfReach and NoPose.
    """
    given = np.zeros(len(sources.SOURCES)) if errors is None else np.asarray(errors, dtype=float)
    r, z = np.asarray(r, dtype=float), np.asarray(z, dtype=float)
    drives = angles(manipulator, r, z)
    start = vector(r, 0.0, z)
    solved, turn, psi, steps = solve(manipulator, drives, start, phi, given)
    return PoseError(solved - start, rotation_vector(turn), psi, steps)


def solve(
    manipulator: Manipulator,
    drives: Array,
    start: Array,
    phi: Array | float = 0.0,
    errors: Array | None = None,
) -> tuple[Array, Array, Array, int]:
    """Position (..., 3) [m], rotation (..., 3, 3), follow-up angle (...) [rad] and steps taken.

    `drives` (..., 3) [rad] are the arm angles from e_r at the azimuth `phi` (...), `start`
    (..., 3) [m] a position nearby. Raises NoPose.
    """
    given = np.zeros(len(sources.SOURCES)) if errors is None else errors
    machine = _machine(manipulator, drives, np.asarray(phi, dtype=float), given)
    shape = np.broadcast_shapes(
        machine.base.shape[:-2], start.shape[:-1], machine.length.shape[:-1]
    )
    position = np.broadcast_to(start, (*shape, 3)).copy()
    turn = np.broadcast_to(np.eye(3), (*shape, 3, 3))
    psi = np.zeros(shape)
    size = np.full(shape, np.inf)
    free = manipulator.follow_up == "rod"
    for count in range(1, MOST_STEPS + 1):
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            step = _step(machine, position, turn, psi, free)
            position = position + step[..., :3]
            turn = rotation_matrix(step[..., 3:6]) @ turn
            psi = psi + step[..., 6] if free else psi
        size = np.abs(step).max(axis=-1, initial=0.0)
        if np.all(size <= ENOUGH):
            return position, turn, psi, count
        if not np.isfinite(size).all():
            break
    raise _no_pose(size)


def _machine(manipulator: Manipulator, drives: Array, phi: Array, errors: Array) -> _Machine:
    m = manipulator
    e = errors.reshape(*errors.shape[:-1], CHAINS, sources.PER_CHAIN)
    u, v, k = axes(drives + e[..., sources.DRIVE_ZERO])
    line = np.broadcast_to(SIDE[:, None] * UP, (CHAINS, 3))  # of the joints, in arm axes
    line = turned(line, e[..., sources.JOINT_LINE_ARM])
    gap = m.distances + e[..., sources.JOINT_DISTANCE_ARM]
    middle = vector(m.arms + e[..., sources.ARM_LENGTH], 0.0, 0.0)
    joints = middle[..., None, :] + (SIDES * gap[..., None])[..., None] * line[..., None, :]
    tilt = e[..., sources.ARM_ORIENTATION]
    frame = np.stack([u, v, k], axis=-1)
    arm = np.einsum("...ab,...jb->...ja", frame, turned(joints, tilt[..., None, :]))
    n = np.array([UP, UP, [0.0, 1.0, 0.0]])
    across = turned(n, e[..., sources.JOINT_LINE_PLATFORM])
    wide = m.distances + e[..., sources.JOINT_DISTANCE_PLATFORM]
    at = m.attachments + e[..., sources.PLATFORM_ATTACHMENT]
    platform = at[..., None, :] + (SIDES * wide[..., None])[..., None] * across[..., None, :]
    length = m.rods[:, None] + e[..., sources.ROD_LENGTH]
    return _Machine(
        base=m.origins + _in_meridian(e[..., sources.ORIGIN], phi[..., None]),
        arm=arm,
        arm_middle=arm[..., 2, :, :].mean(axis=-2),
        platform=platform,
        middle=at[..., 2, :],
        length=length.reshape(*length.shape[:-2], 2 * CHAINS),
    )


def _in_meridian(v: Array, phi: Array) -> Array:
    """Base-fixed vectors (..., 3) in the axes at the azimuth phi (...)."""
    c, s = np.cos(phi), np.sin(phi)
    return vector(c * v[..., 0] + s * v[..., 1], c * v[..., 1] - s * v[..., 0], v[..., 2])


def _step(machine: _Machine, position: Array, turn: Array, psi: Array, free: bool) -> Array:
    """Newton's step (..., 6 or 7): of the position, of the rotation (from the left), of psi."""
    arm = machine.arm
    if free:
        arm = np.broadcast_to(arm, (*psi.shape, *arm.shape[-3:])).copy()
        arm[..., 2, :, :] = _in_meridian(arm[..., 2, :, :], -psi[..., None])
    seat = np.einsum("...ab,...ijb->...ija", turn, machine.platform)
    rods = position[..., None, None, :] + seat - machine.base[..., None, :] - arm
    size = np.sqrt(dot(rods, rods))
    w = rods / size[..., None]
    slope = np.concatenate([w, cross(seat, w)], axis=-1)
    slope = slope.reshape(*psi.shape, 2 * CHAINS, 6)
    rest = size.reshape(*psi.shape, 2 * CHAINS) - machine.length
    if free:
        by_psi = np.zeros_like(size)
        by_psi[..., 2, :] = -dot(w[..., 2, :, :], cross(UP, arm[..., 2, :, :]))
        beside, own = _follow_up(machine, position, turn, psi)
        slope = np.concatenate([slope, by_psi.reshape(*psi.shape, 2 * CHAINS, 1)], axis=-1)
        slope = np.concatenate([slope, own[..., None, :]], axis=-2)
        rest = np.concatenate([rest, beside[..., None]], axis=-1)
    try:
        return np.linalg.solve(slope, -rest[..., None])[..., 0]
    except np.linalg.LinAlgError:
        return np.full_like(rest, np.nan)


def _follow_up(machine: _Machine, position: Array, turn: Array, psi: Array) -> tuple[Array, Array]:
    """Distance (...) [m] of chain 3's platform end from the follow-up plane, slopes (..., 7)."""
    c, s = np.cos(psi), np.sin(psi)
    e_r, e_t = vector(c, s, 0.0), vector(-s, c, 0.0)
    seat = np.einsum("...ab,...b->...a", turn, machine.middle)
    arm = _in_meridian(machine.arm_middle, -psi)
    line = position + seat - machine.base[..., 2, :] - arm
    by_psi = -dot(line, e_r) - dot(arm, e_r)
    return dot(line, e_t), np.concatenate([e_t, cross(seat, e_t), by_psi[..., None]], axis=-1)


def _no_pose(size: Array) -> NoPose:
    bad = ~(size <= ENOUGH)
    first = int(np.flatnonzero(bad)[0])
    message = (
        f"Newton's method finds no pose ({int(bad.sum())} of {size.size} fail; the last step of"
        f" this one is {size.flat[first]:.3g}); give smaller errors, or another pose"
    )
    return NoPose([Fault(f"pose {first}", message)])
