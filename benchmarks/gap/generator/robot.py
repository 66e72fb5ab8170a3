"""The parallel manipulator of the notes, own code: its inverse, exact pose and statics [m, rad].

All vectors stand in the axes (e_r, e_t, z) at the azimuth of the command, where the plane of
chain 3 stands (model M1).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.gap.generator.tables import Array

ARMS = np.array([0.400, 0.400, 0.260])
RODS = np.array([0.480, 0.480, 0.420])
JOINTS = np.array([0.080, 0.080, 0.100])
ORIGINS = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.150]])
SEATS = np.array([[0.0, 0.060, 0.0], [0.0, -0.060, 0.0], [-0.045, 0.0, 0.0]])
LINES = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
SIDES = np.array([0.5, -0.5])
CLOSED = 1e-14
"""Half of what squared rod lengths [m2] may be off: lengths then are met within 1e-10 mm."""
MOST_STEPS = 30


@dataclass(frozen=True)
class Robot:
    """Lengths of the arms (3,) or (n, 3), of the rods (3, 2) or (n, 3, 2), and a growth of every
    length, a number or (n, 1, 1).
    """

    arms: Array = field(default_factory=ARMS.copy)
    rods: Array = field(default_factory=lambda: np.repeat(RODS[:, None], 2, axis=1))
    growth: Array | float = 0.0


@dataclass(frozen=True)
class Pose:
    """Where platforms (n,) are: `place` (n, 3), `turn` (n, 3, 3) from their nominal frame; the
    `rods` (n, 3, 2, 3) from arm to platform, the joints' `levers` (n, 3, 2, 3) about the place, and
    how the ends of the `arms` (n, 3, 3) move with their angles.
    """

    place: Array
    turn: Array
    rods: Array
    levers: Array
    arms: Array

    @property
    def slopes(self) -> Array:
        """Derivative (n, 6, 6) of half the squared rod lengths by place and rotation."""
        rods, levers = self.rods, self.levers
        both = np.concatenate([rods, np.cross(levers, rods)], axis=-1)
        return np.asarray(both.reshape(len(rods), 6, 6))


def angles(r: Array, z: Array) -> Array:
    """Angles (n, 3) of the arms from e_r, elbows out and up, that put the platform at r, z."""
    found = []
    for chain, side in ((0, 1.0), (1, -1.0)):
        y = SEATS[chain, 1]
        rho = np.hypot(r, y)
        cosine = rho**2 + ARMS[chain] ** 2 + z**2 - RODS[chain] ** 2
        bend = np.arccos(cosine / (2.0 * rho * ARMS[chain]))
        found.append(np.arctan2(y, r) + side * bend)
    x, up = r + SEATS[2, 0], z - ORIGINS[2, 2]
    far = np.hypot(x, up)
    bend = np.arccos((far**2 + ARMS[2] ** 2 - RODS[2] ** 2) / (2.0 * far * ARMS[2]))
    return np.column_stack([*found, np.arctan2(up, x) + bend])


def directions(theta: Array) -> tuple[Array, Array]:
    """Unit vectors (n, 3, 3) along the arms, and where these move as their angles grow."""
    c, s = np.cos(theta), np.sin(theta)
    along, ahead = np.zeros((*theta.shape, 3)), np.zeros((*theta.shape, 3))
    along[..., 0], ahead[..., 0] = c, -s
    along[:, :2, 1], ahead[:, :2, 1] = s[:, :2], c[:, :2]
    along[:, 2, 2], ahead[:, 2, 2] = s[:, 2], c[:, 2]
    return along, ahead


def pose(robot: Robot, theta: Array, start: Array) -> Pose:
    """The exact pose of arms at `theta` (n, 3), by Newton's method from `start` (n, 3).

    Raises ArithmeticError where it finds none.
    """
    scale = 1.0 + np.asarray(robot.growth)
    along, ahead = directions(theta)
    arms = np.broadcast_to(robot.arms, theta.shape)[..., None] * scale
    pair = scale[..., None] * SIDES[:, None] * (JOINTS[:, None] * LINES)[:, None, :]
    ends = (scale * ORIGINS + arms * along)[..., None, :] + pair
    seats = scale[..., None] * SEATS[:, None, :] + pair
    lengths = robot.rods * scale
    place, turn = start.copy(), np.tile(np.eye(3), (len(theta), 1, 1))
    for _ in range(MOST_STEPS):
        levers = np.einsum("nab,ncjb->ncja", turn, np.broadcast_to(seats, ends.shape))
        rods = place[:, None, None, :] + levers - ends
        found = Pose(place, turn, rods, levers, arms * ahead)
        open_by = 0.5 * (lengths**2 - (rods**2).sum(axis=-1))
        if np.abs(open_by).max() < CLOSED:
            return found
        step = np.linalg.solve(found.slopes, open_by.reshape(-1, 6, 1))[..., 0]
        place = place + step[:, :3]
        turn = Rotation.from_rotvec(step[:, 3:]).as_matrix() @ turn
    raise ArithmeticError("Newton's method finds no pose")


def at(robot: Robot, r: Array, z: Array, off: Array | float = 0.0) -> Pose:
    """The pose of a robot told to stand at r, z (n,), its drives off by `off` (n, 3)."""
    start = np.column_stack([r, np.zeros_like(r), z])
    return pose(robot, angles(r, z) + off, start)


def lifts(found: Pose) -> tuple[Array, Array]:
    """How far platforms rise per radian of each drive (n, 3), per metre of each rod (n, 3, 2).

    From the virtual work of a weight at the platform's place: the forces in the rods that hold it.
    """
    up = np.zeros((len(found.place), 6, 1))
    up[:, 2] = 1.0
    held = np.linalg.solve(found.slopes.swapaxes(1, 2), up).reshape(found.rods.shape[:3])
    moments = np.einsum("ncj,ncja,nca->nc", held, found.rods, found.arms)
    return moments, held * np.linalg.norm(found.rods, axis=-1)


def departure(found: Pose, r: Array, z: Array) -> tuple[Array, Array]:
    """Errors (n, 3) of the place and rotation vectors (n, 3) in the axes at the command."""
    wanted = np.column_stack([r, np.zeros_like(r), z])
    return found.place - wanted, Rotation.from_matrix(found.turn).as_rotvec()
