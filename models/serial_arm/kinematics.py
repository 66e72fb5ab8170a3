"""Frames of a serial arm at many poses: motion of the tool by its joints and its errors.

A rotation d about an axis z through o moves the tool p by d z x (p - o); a length along an axis
moves it along that axis. So the axes of the frames give the derivatives of the pose (Whitney 1972),
including those by errors of the table.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...section import Array
from ..robot import GRAVITY

# Forward kinematics of a chain of revolute joints (Denavit and Hartenberg 1955).
#
# The transform of a joint is Rot_z(theta) Trans_z(d) Trans_x(a) Rot_x(alpha) Rot_y(beta). beta is
# Hayati's fifth parameter, 0 nominally: with two neighbouring axes parallel a small change of the
# table's four moves the common normal without limit (Hayati and Mirmirani, J. Robotic Systems 2,
# 1985).


@dataclass(frozen=True, slots=True)
class Chain:
    """Joints (k,) from the base: lengths [m], angles [rad].

    `zero` is added to every joint angle. `base` (6,) and `tool` (3,) locate the chain's frame and
    the measured point: position [m] and rotation vector [rad] in the measuring frame, and
    position [m] in the last joint's frame.
    """

    zero: Array
    d: Array
    a: Array
    alpha: Array
    beta: Array
    base: Array
    tool: Array


def positions(chain: Chain, angles: Array) -> Array:
    """Measured point (n, 3) [m] at joint angles (n, k) [rad]."""
    point = np.broadcast_to(chain.tool, (len(angles), 3))
    for at in range(len(chain.d) - 1, -1, -1):
        point = _transform_by_joint(chain, at, angles[:, at] + chain.zero[at], point)
    return np.asarray(point @ rotation(chain.base[3:]).T + chain.base[:3])


def _transform_by_joint(chain: Chain, at: int, theta: Array, point: Array) -> Array:
    """A point (n, 3) of the frame after joint `at`, in the frame before it."""
    x, y, z = point.T
    cos, sin = np.cos(chain.beta[at]), np.sin(chain.beta[at])
    x, z = cos * x + sin * z, cos * z - sin * x
    cos, sin = np.cos(chain.alpha[at]), np.sin(chain.alpha[at])
    x, y, z = x + chain.a[at], y * cos - z * sin, y * sin + z * cos
    c, s = np.cos(theta), np.sin(theta)
    return np.column_stack([c * x - s * y, s * x + c * y, z + chain.d[at]])


def rotation(vector: Array) -> Array:
    """The matrix (3, 3) of a rotation vector (3,) [rad] (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.asarray(vector) / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


@dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """The frames of a chain of k joints at n poses, in the measuring frame.

    `origin` (n, k + 1, 3) [m] and `turn` (n, k + 1, 3, 3) are those of the base and of the frame
    after every joint; `knee` (n, k, 3, 3) are the axes after Trans_x(a), before the twists alpha
    and beta; `twisted` (n, k, 3, 3) those after alpha. `tool` (n, 3) is the measured point.
    """

    origin: Array
    turn: Array
    knee: Array
    twisted: Array
    tool: Array

    @property
    def axes(self) -> Array:
        """Axes (n, k, 3) that the joints turn about."""
        return self.turn[:, :-1, :, 2]

    def joints(self) -> tuple[Array, Array]:
        """Motion (n, 3, k) [m/rad] and rotation (n, 3, k) [rad/rad] of the tool by the joints."""
        return self._turned(self.axes, self.origin[:, :-1])

    def errors(self) -> tuple[Array, Array]:
        """Motion and rotation (n, 3, 5 k) of the tool by zero, d, a, alpha, beta of each joint.

        Per rad of an angle, per m of a length.
        """
        ends = self.origin[:, 1:]
        zero = self.joints()
        alpha = self._turned(self.knee[..., 0], ends)
        beta = self._turned(self.twisted[..., 1], ends)
        directions = [np.swapaxes(axis, 1, 2) for axis in (self.axes, self.knee[..., 0])]
        still = np.zeros_like(directions[0])
        parts = (zero, (directions[0], still), (directions[1], still), alpha, beta)
        move, turn = (np.stack(components, axis=3) for components in zip(*parts, strict=True))
        return move.reshape(len(move), 3, -1), turn.reshape(len(turn), 3, -1)

    def _turned(self, axis: Array, through: Array) -> tuple[Array, Array]:
        """Motion and rotation of the tool by rotations about axes through points, (n, k, 3)."""
        move = np.cross(axis, self.tool[:, None, :] - through)
        return np.swapaxes(move, 1, 2), np.swapaxes(axis, 1, 2)


def frames(chain: Chain, angles: Array) -> Frames:
    """The frames at joint angles (n, k) [rad]."""
    n, k = angles.shape
    origin, turn = np.empty((n, k + 1, 3)), np.empty((n, k + 1, 3, 3))
    knee, twisted = np.empty((n, k, 3, 3)), np.empty((n, k, 3, 3))
    origin[:, 0], turn[:, 0] = chain.base[:3], rotation(chain.base[3:])
    for at in range(k):
        theta = angles[:, at] + chain.zero[at]
        knee[:, at] = turn[:, at] @ _about_z(theta)
        origin[:, at + 1] = origin[:, at] + chain.d[at] * turn[:, at, :, 2] + chain.a[at] * knee[:, at, :, 0]
        twisted[:, at] = knee[:, at] @ rotation(np.array([chain.alpha[at], 0.0, 0.0]))
        turn[:, at + 1] = twisted[:, at] @ rotation(np.array([0.0, chain.beta[at], 0.0]))
    tool = origin[:, -1] + turn[:, -1] @ chain.tool
    return Frames(origin, turn, knee, twisted, tool)


def _about_z(theta: Array) -> Array:
    """Rotations (n, 3, 3) about z."""
    matrices = np.zeros((len(theta), 3, 3))
    matrices[:, 0, 0] = matrices[:, 1, 1] = np.cos(theta)
    matrices[:, 1, 0] = np.sin(theta)
    matrices[:, 0, 1] = -matrices[:, 1, 0]
    matrices[:, 2, 2] = 1.0
    return matrices


# Joint angles of a serial arm at poses of its tool (Levenberg 1944; Sugihara 2011).


STEPS = 120
HOPELESS = 1e12
"""Damping, as a factor, above which the search for a pose ends: no step reduces its residual."""
POSITION_TOLERANCE = 1e-9
"""Residual [m, or rad times the length of the arm] that counts as reached."""
SEEDS = (-1.0, 0.0, 1.0)
"""Shifts [rad] of the desired angles at which the search for the first pose begins."""
SHIFTED = 5
"""Joints that are shifted: the last turns about the tool."""
MAX_STEP_RAD = 0.5
"""Longest step of a joint [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class Reached:
    """Angles (n, k) [rad] nearest to poses, and the residual distances `missing` (n,) [m]."""

    angles: Array
    missing: Array

    @property
    def within(self) -> NDArray[np.bool_]:
        """Whether each pose is reached."""
        return self.missing <= POSITION_TOLERANCE


def reach(chain: Chain) -> float:
    """Length of a chain [m]: no point is farther than this from its base."""
    return float(np.sum(np.hypot(chain.a, chain.d)) + np.linalg.norm(chain.tool))


def inverse(chain: Chain, position: Array, turn: Array, start: Array, low: Array, high: Array) -> Reached:
    """The angles within [low, high] (k,) nearest to each pose, from `start` (n, k).

    `position` (n, 3) [m], `turn` (n, 3, 3); with fewer than six joints the position alone counts.
    """
    q, scale = np.clip(start, low, high), reach(chain)
    with_rotation = len(chain.d) >= 6
    r, jacobian = _residual(frames(chain, q), position, turn, scale, with_rotation)
    damping = np.ones(len(q))
    for _ in range(STEPS):
        rows = np.flatnonzero((np.linalg.norm(r, axis=1) > 0.01 * POSITION_TOLERANCE) & (damping < HOPELESS))
        if not len(rows):
            break
        step = _step(jacobian[rows], r[rows], scale, damping[rows])
        ends = ((q[rows] <= low) & (step < 0.0)) | ((q[rows] >= high) & (step > 0.0))
        step = _step(np.where(ends[:, None, :], 0.0, jacobian[rows]), r[rows], scale, damping[rows])
        tried = np.clip(q[rows] + step, low, high)
        new_r, new_jacobian = _residual(frames(chain, tried), position[rows], turn[rows], scale, with_rotation)
        better = np.sum(new_r**2, axis=1) < np.sum(r[rows] ** 2, axis=1)
        improved = rows[better]
        q[improved], r[improved] = tried[better], new_r[better]
        jacobian[improved] = new_jacobian[better]
        damping[rows] *= np.where(better, 0.2, 10.0)
        damping[rows] = np.maximum(damping[rows], 1e-6)
    return Reached(q, np.linalg.norm(r, axis=1))


def _residual(now: Frames, position: Array, turn: Array, scale: float, with_rotation: bool) -> tuple[Array, Array]:
    """The residual (n, 3 or 6) [m], rotations times `scale`, and its derivative by -angles."""
    move, rotate = now.joints()
    r = position - now.tool
    if not with_rotation:
        return r, move
    current = now.turn[:, -1]
    apart = 0.5 * np.sum(np.cross(current, turn, axis=1), axis=2)
    opposite = np.einsum("nij,nij->n", current, turn) < -0.999  # half a turn: about any axis
    apart[opposite] += current[opposite][:, :, 0]
    return np.hstack([r, scale * apart]), np.concatenate([move, scale * rotate], axis=1)


def _step(jacobian: Array, r: Array, scale: float, damping: Array) -> Array:
    """Damped least squares; the damping falls with the residual."""
    diagonal = damping * 1e-3 * np.sum(r**2, axis=1) + 1e-13 * scale**2
    square = jacobian @ np.swapaxes(jacobian, 1, 2)
    square += diagonal[:, None, None] * np.eye(square.shape[1])
    step = np.einsum("nij,ni->nj", jacobian, np.linalg.solve(square, r[..., None])[..., 0])
    longest = np.maximum(np.abs(step).max(axis=1, keepdims=True) / MAX_STEP_RAD, 1.0)
    return np.asarray(step / longest)


def inverse_over_cell(chain: Chain, position: Array, turn: Array, near: Array, low: Array, high: Array) -> Reached:
    """The same of all poses (n,) of a cell in one posture: that of the pose in the middle which is
    nearest to the angles `near` (k,), from which the search of all other poses starts.
    """
    middle = int(np.argmin(np.sum((position - position.mean(axis=0)) ** 2, axis=1)))
    shifts = np.array(list(product(SEEDS, repeat=min(len(near), SHIFTED))))
    starts = np.tile(near, (len(shifts), 1))
    starts[:, : shifts.shape[1]] += shifts
    positions, turns = (np.repeat(part[middle][None], len(starts), axis=0) for part in (position, turn))
    first = inverse(chain, positions, turns, starts, low, high)
    apart = np.max(np.abs(first.angles - near), axis=1)
    best = np.lexsort((np.round(apart, 6), np.round(first.missing, 9)))[0]
    start = np.tile(first.angles[best], (len(position), 1))
    return inverse(chain, position, turn, start, low, high)


# Torques of gravity on the joints of a serial arm (virtual work).


def gravity_torques(frames: Frames, mass: Array, centre: Array, payload: float = 0.0) -> Array:
    """Torque (n, k) [N m] that each drive must hold: m g dz/dtheta of all links beyond it.

    `mass` (k,) [kg] and `centre` (k, 3) [m] of the links, the latter in the frame after the joint;
    `payload` [kg] at the tool; gravity acts along -z of the measuring frame.
    """
    centres = frames.origin[:, 1:] + np.einsum("nkij,kj->nki", frames.turn[:, 1:], centre)
    weights = np.append(mass, payload)
    points = np.concatenate([centres, frames.tool[:, None, :]], axis=1)
    # moments of the masses about the origin, summed from the tool inwards
    mass_beyond = np.cumsum(weights[::-1])[::-1][: len(mass)]
    moment = np.cumsum((weights[:, None] * points)[:, ::-1], axis=1)[:, ::-1][:, : len(mass)]
    lever = moment - mass_beyond[:, None] * frames.origin[:, :-1]
    return np.asarray(GRAVITY * np.cross(frames.axes, lever)[..., 2])


# Whether a serial arm reaches the poses of its cell, and which joint prevents it.


SINGULAR = 1e-3
"""Least over largest singular value of the Jacobian, lengths in those of the arm, of a pose that
counts as singular."""
ALIGNED = 0.35
"""Sine of the angle at a joint that counts as stretched or folded."""
DEPENDENCE_FRACTION = 0.3
"""Component in a dependent motion, over the largest, from which a joint belongs to it."""


def blocking_joints(chain: Chain, reached: Reached, low: Array, high: Array) -> list[str]:
    """The joint that prevents each pose; empty where the pose is reached."""
    missed = np.flatnonzero(~reached.within)
    reasons = [""] * len(reached.angles)
    stretched = _stretched_joint(chain, frames(chain, reached.angles[missed]))
    for row, at in enumerate(missed):
        q = reached.angles[at]
        stopped = np.flatnonzero((q <= low + 1e-9) | (q >= high - 1e-9))
        if len(stopped):
            names = " and ".join(map(str, stopped + 1))
            ends = ", ".join(f"{np.degrees(q[joint]):.4g} deg" for joint in stopped)
            reasons[at] = f"joint {names} is at the end of its range ({ends})"
        elif stretched[row] >= 0:
            reasons[at] = f"joint {stretched[row] + 1} is stretched or folded"
        else:
            reasons[at] = "no joint moves the tool closer to it"
    return reasons


def _stretched_joint(chain: Chain, now: Frames) -> NDArray[np.int64]:
    """The joint (n,) whose rotation changes the distance of the tool from the joint before it most
    over a turn, but not at this pose: that distance is at its maximum, or its minimum.

    It is constant + 2 r s cos(theta + ...) of the distances r and s of both from the axis. -1 where
    there is no such joint: the arm has one only, or the pose lies off the surface that it reaches.
    """
    axis, size = now.axes[:, 1:], reach(chain)
    ends = now.tool[:, None, :] - now.origin[:, 1:-1], now.origin[:, :-2] - now.origin[:, 1:-1]
    levers = [np.cross(axis, end) for end in ends]
    swing = np.prod([np.linalg.norm(lever, axis=2) for lever in levers], axis=0)
    slope = np.abs(np.sum(levers[0] * (ends[0] - ends[1]), axis=2))
    aligned = slope <= ALIGNED * swing + 1e-9 * size**2
    swing = np.where(aligned & (swing > 1e-9 * size**2), swing, 0.0)
    swing = np.concatenate([np.zeros((len(swing), 1)), swing], axis=1)  # joint 1: no joint before it
    most = np.argmax(swing, axis=1)
    return np.asarray(np.where(most > 0, most, -1))


def singular_joints(chain: Chain, now: Frames) -> list[str]:
    """The joints that move the tool dependently at each pose; empty where it is regular."""
    move, turn = now.joints()
    jacobian = move / reach(chain)
    if move.shape[2] >= 6:
        jacobian = np.concatenate([jacobian, turn], axis=1)
    rank = min(jacobian.shape[1:])
    _, sizes, rows = np.linalg.svd(jacobian)
    joints = []
    for size, row in zip(sizes, rows, strict=True):
        if size[rank - 1] > SINGULAR * size[0]:
            joints.append("")
            continue
        component = np.abs(row[rank - 1])
        dependent = np.flatnonzero(component > DEPENDENCE_FRACTION * component.max()) + 1
        joints.append(" and ".join(map(str, dependent)))
    return joints


# The poses of a cell: a grid or the test poses of ISO 9283 in a cube, or a list.


KINDS = ("grid", "iso_cube")
ISO = 0.8
"""Fraction of a diagonal of the cube that the test poses span (ISO 9283:1998, 6.2)."""


@dataclass(frozen=True, slots=True)
class Cell:
    """Where the arm works: lengths [m], angles [rad], in the measuring frame.

    `kind` is one of `KINDS` about `centre` in a cube of edges `side`, a grid with `per_edge` poses
    along each, or empty where `listed` holds the poses: rows of a position, of a position and a
    rotation vector, or (`in_joints`) of joint angles. `turn` (3,) is the rotation vector of the
    last frame where a row has none; the default points its z axis down. Positions are those of the
    last frame's origin, of the tool with `of_tool`. `near` (k,) are joint angles that select the
    posture of the arm; empty: all 0.
    """

    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    side: float = 0.0
    kind: str = "grid"
    per_edge: int = 5
    listed: tuple[tuple[float, ...], ...] = ()
    in_joints: bool = False
    turn: tuple[float, float, float] = (np.pi, 0.0, 0.0)
    near: tuple[float, ...] = ()
    of_tool: bool = False

    def poses(self) -> tuple[Array, Array]:
        """Positions (n, 3) [m] and rotations (n, 3, 3), of equal weight."""
        if self.listed:
            rows = np.array(self.listed)
            vectors = rows[:, 3:] if rows.shape[1] == 6 else np.tile(self.turn, (len(rows), 1))
            return rows[:, :3], np.array([rotation(vector) for vector in vectors])
        unit = _grid(self.per_edge) if self.kind == "grid" else _iso_cube()
        turn = np.repeat(rotation(np.array(self.turn))[None], len(unit), axis=0)
        return np.array(self.centre) + self.side * unit, turn


def _grid(count: int) -> Array:
    """Points of a cube of edge 1 about the origin, its faces included."""
    edge = np.linspace(-0.5, 0.5, count) if count > 1 else np.zeros(1)
    return np.stack(np.meshgrid(edge, edge, edge, indexing="ij"), axis=-1).reshape(-1, 3)


def _iso_cube() -> Array:
    """P1 to P5: the centre, and four in the plane C1 C2 C7 C8 on the cube's diagonals."""
    corners = [(1, 1, 1), (-1, 1, 1), (-1, -1, -1), (1, -1, -1)]
    return np.array([(0, 0, 0), *corners]) * 0.5 * ISO
