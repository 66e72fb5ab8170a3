"""Maps from joint errors of any machine to its tool, by pose."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ...arrays import Array

WHOLE = 6
"""Least number of joints with which position and orientation can both be kept."""
NOT_MOVING = 1e-9
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
        whole = self.move.shape[2] >= WHOLE
        rows = np.concatenate([self.move, self.turn], axis=1) if whole else self.move
        rate = np.einsum("nji,ki->knj", np.linalg.pinv(rows)[:, :, :3], directions)
        return np.where(np.abs(rate) > NOT_MOVING * np.abs(rate).max(), np.sign(rate), 0.0)

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
