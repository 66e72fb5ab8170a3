"""Whether a serial arm reaches the poses of its cell, and which joint prevents it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from .chain import Chain
from .frames import Frames, frames
from .inverse import Reached, reach

SINGULAR = 1e-3
"""Least over largest singular value of the Jacobian, lengths in those of the arm, of a pose that
counts as singular."""
ALIGNED = 0.35
"""Sine of the angle at a joint that counts as stretched or folded."""
ALIKE = 0.3
"""Component in a dependent motion, over the largest, from which a joint belongs to it."""


def blocking(chain: Chain, reached: Reached, low: Array, high: Array) -> list[str]:
    """The joint that prevents each pose; empty where the pose is reached."""
    missed = np.flatnonzero(~reached.within)
    reasons = [""] * len(reached.angles)
    stretched = _stretched(chain, frames(chain, reached.angles[missed]))
    for row, at in enumerate(missed):
        q = reached.angles[at]
        stopped = np.flatnonzero((q <= low + 1e-9) | (q >= high - 1e-9))
        if len(stopped):
            names = " and ".join(map(str, stopped + 1))
            ends = ", ".join(f"{np.degrees(q[joint]):.4g} deg" for joint in stopped)
            reasons[at] = f"joint {names} is at the end of its range ({ends})"
        else:
            reasons[at] = f"joint {stretched[row] + 1} is stretched or folded"
    return reasons


def _stretched(chain: Chain, now: Frames) -> NDArray[np.int64]:
    """The joint (n,) whose rotation changes the distance of the tool from the joint before it most
    over a turn, but not at this pose: that distance is at its maximum, or its minimum.

    It is constant + 2 r s cos(theta + ...) of the distances r and s of both from the axis.
    """
    axis, size = now.axes[:, 1:], reach(chain)
    ends = now.tool[:, None, :] - now.origin[:, 1:-1], now.origin[:, :-2] - now.origin[:, 1:-1]
    levers = [np.cross(axis, end) for end in ends]
    swing = np.prod([np.linalg.norm(lever, axis=2) for lever in levers], axis=0)
    slope = np.abs(np.sum(levers[0] * (ends[0] - ends[1]), axis=2))
    aligned = slope <= ALIGNED * swing + 1e-9 * size**2
    return np.asarray(np.argmax(np.where(aligned, swing, 0.0), axis=1) + 1)


def singular(chain: Chain, now: Frames) -> list[str]:
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
        dependent = np.flatnonzero(component > ALIKE * component.max()) + 1
        joints.append(" and ".join(map(str, dependent)))
    return joints
