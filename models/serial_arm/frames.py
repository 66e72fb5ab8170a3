"""Frames of a serial arm at many poses: motion of the tool by its joints and its errors.

A rotation d about an axis z through o moves the tool p by d z x (p - o); a length along an axis
moves it along that axis. So the axes of the frames give the derivatives of the pose (Whitney 1972),
including those by errors of the table.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .chain import Chain, rotation


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
