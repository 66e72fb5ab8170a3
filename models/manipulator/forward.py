"""Exact pose of a manipulator with any elementary errors, by Newton's method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from ...errors import Fault, InputError
from .geometry import Manipulator
from .inverse import angles
from .machine import UP, Machine, about_up, built
from .sources import NAMES
from .vectors import cofactors, cross, dot, rotation_vector, solved, turned, vector

ENOUGH = 1e-9
"""Newton's last step [m, rad]: the next would be its square, below rounding."""
MOST_STEPS = 20
BLOCK = 2048
"""Machines that are solved at once: so many fit into a processor's cache."""


class NoPose(InputError):
    """Errors, or a start, with which Newton's method does not converge."""


@dataclass(frozen=True, slots=True)
class PoseError:
    """Errors of poses (...), in the axes (e_r, e_t, z) at their azimuth.

    `position` (..., 3) [m]: dr, dt, dz; `orientation` (..., 3) [rad]: the rotation vector (two
    tilts, whose length is the squareness, and the yaw); `follow_up` (...) [rad]: how far the
    follow-up plane is turned (0 in model M1); `steps`: the most steps of Newton's method.
    """

    position: Array
    orientation: Array
    follow_up: Array
    steps: int


@dataclass(frozen=True, slots=True)
class _State:
    """Poses (n,) during the iteration.

    `position` (n, 3), platform axes `frame` (n, 3 axes, 3), joints on the platform `seat`
    (n, 3, 2, 3) and their `middle` of chain 3 (n, 3), both turned with it, and the follow-up angle
    `psi` (n,).
    """

    position: Array
    frame: Array
    seat: Array
    middle: Array
    psi: Array


def exact_pose(
    manipulator: Manipulator, r: Array | float, z: Array | float, phi: Array | float = 0.0, errors: Array | None = None
) -> PoseError:
    """The pose that the drives reach at the nominal angles of r, z [m], phi [rad].

    `errors` (..., 63) [m, rad] in the order of `sources.SOURCES`; poses (...) and errors broadcast:
    r[:, None] with errors (m, 63) gives every pose of every machine. Raises OutOfReach and NoPose.
    """
    r, z = np.asarray(r, dtype=float), np.asarray(z, dtype=float)
    start = vector(r, 0.0, z)
    return solve(manipulator, angles(manipulator, r, z), start, phi, errors)


def solve(
    manipulator: Manipulator, drives: Array, start: Array, phi: Array | float = 0.0, errors: Array | None = None
) -> PoseError:
    """The poses, relative to `start` (..., 3) [m], of arms at `drives` (..., 3) [rad] from e_r.

    `phi` (...) [rad] is the azimuth of e_r; in model M1 the follow-up plane stands there. The
    closures |B - A| = l2 of the six rods, with the middle of chain 3 in its plane in model M2, are
    solved by Newton's method with analytic slopes from `start` on. Raises NoPose.
    """
    error_vectors = np.zeros(len(NAMES)) if errors is None else np.asarray(errors, dtype=float)
    azimuth = np.asarray(phi, dtype=float)
    heads = (drives.shape[:-1], start.shape[:-1], azimuth.shape, error_vectors.shape[:-1])
    shape = np.broadcast_shapes(*heads)
    count = int(np.prod(shape))
    flat = [np.broadcast_to(a, (*shape, a.shape[-1])) for a in (drives, start, error_vectors)]
    flat = [a.reshape(count, a.shape[-1]) for a in flat]
    azimuth = np.broadcast_to(azimuth, shape).reshape(count)
    position, turn, psi = np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
    steps = 0
    for first in range(0, count, BLOCK):
        at = slice(first, first + BLOCK)
        machine = built(manipulator, flat[0][at], azimuth[at], flat[2][at])
        state, steps_taken = _newton(machine, flat[1][at], manipulator.follow_up == "rod", first)
        position[at], psi[at] = state.position - flat[1][at], state.psi
        turn[at] = rotation_vector(state.frame)
        steps = max(steps, steps_taken)
    return PoseError(position.reshape(*shape, 3), turn.reshape(*shape, 3), psi.reshape(shape), steps)


def _newton(machine: Machine, start: Array, free: bool, first: int) -> tuple[_State, int]:
    """The solved poses and the steps taken; `first` is the number of the first pose."""
    count = len(start)
    frame = np.broadcast_to(np.eye(3), (count, 3, 3))
    state = _State(start, frame, machine.platform, machine.middle, np.zeros(count))
    size = np.full(count, np.inf)
    for step in range(1, MOST_STEPS + 1):
        with np.errstate(all="ignore"):
            move, turn, twist = _step(machine, state, free)
            state = _State(
                state.position + move,
                turned(state.frame, turn[:, None, :]),
                turned(state.seat, turn[:, None, None, :]),
                turned(state.middle, turn),
                state.psi + twist,
            )
            size = np.maximum(np.abs(move).max(axis=-1), np.abs(turn).max(axis=-1))
            size = np.maximum(size, np.abs(twist))
        if np.all(size <= ENOUGH):
            return state, step
        if not np.isfinite(size).all():
            break
    raise _no_pose(size, first)


def _step(machine: Machine, state: _State, free: bool) -> tuple[Array, Array, Array]:
    """Newton's step: of the position (n, 3), of the rotation (n, 3) from the left, of psi (n,)."""
    arm = machine.arm
    if free:
        arm = arm.copy(order="K")
        arm[:, 2] = about_up(arm[:, 2], state.psi[:, None])
    rods = state.position[:, None, None, :] + state.seat - machine.base[:, :, None, :] - arm
    size = np.sqrt(dot(rods, rods))
    w = rods / size[..., None]
    lever = cross(state.seat, w)
    move, turn = _separated(w, lever, machine.length - size)
    if not free:
        return move, turn, np.zeros(len(move))
    by_psi = np.zeros_like(size)
    by_psi[:, 2] = dot(w[:, 2], cross(UP, arm[:, 2]))
    along, about = _separated(w, lever, by_psi)  # derivatives of the pose by psi
    distance, on_move, on_turn, on_psi = _follow_up(machine, state)
    residual = -distance - dot(on_move, move) - dot(on_turn, turn)
    twist = residual / (on_psi + dot(on_move, along) + dot(on_turn, about))
    return move + twist[:, None] * along, turn + twist[:, None] * about, twist


def _separated(w: Array, lever: Array, right: Array) -> tuple[Array, Array]:
    """Solutions (n, 3) and (n, 3) of w.x + lever.y = right, one equation per rod (n, 3, 2).

    Half sums and differences of the rods of a parallelogram: the former hold the position, the
    latter, in which w all but cancels, the orientation.
    """
    w_sum, lever_sum, right_sum = (0.5 * (a[:, :, 0] + a[:, :, 1]) for a in (w, lever, right))
    w_gap, lever_gap, right_gap = (a[:, :, 0] - a[:, :, 1] for a in (w, lever, right))
    columns = cofactors(w_sum)
    determinant = dot(w_sum[:, 0], columns[0])[:, None]
    rows, remaining = lever_gap, right_gap
    for chain, column in enumerate(columns):
        factors = dot(w_gap, column[:, None, :]) / determinant
        rows = rows - factors[..., None] * lever_sum[:, chain, None, :]
        remaining = remaining - factors * right_sum[:, chain, None]
    turn = solved(rows, remaining)
    return solved(w_sum, right_sum - dot(lever_sum, turn[:, None, :])), turn


def _follow_up(machine: Machine, state: _State) -> tuple[Array, Array, Array, Array]:
    """Distance (n,) [m] of chain 3's platform end from the follow-up plane, and its slopes.

    By the position (n, 3), the rotation (n, 3) and psi (n,).
    """
    c, s = np.cos(state.psi), np.sin(state.psi)
    e_r, e_t = vector(c, s, 0.0), vector(-s, c, 0.0)
    arm = about_up(machine.arm_middle, state.psi)
    reach = state.position + state.middle - machine.base[:, 2]
    return dot(reach - arm, e_t), e_t, cross(state.middle, e_t), -dot(reach, e_r)


def _no_pose(size: Array, first: int) -> NoPose:
    bad = np.flatnonzero(~(size <= ENOUGH))
    message = (
        f"Newton's method does not converge ({len(bad)} of {len(size)} poses in its block fail; its last step "
        f"is {size[bad[0]]:.3g}); give smaller errors, or another pose"
    )
    return NoPose([Fault(f"pose {first + int(bad[0]) + 1}", message)])
