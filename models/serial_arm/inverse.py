"""Joint angles of a serial arm at poses of its tool (Levenberg 1944; Sugihara 2011)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from .chain import Chain
from .frames import Frames, frames

STEPS = 120
HOPELESS = 1e12
"""Damping, as a factor, above which the search for a pose ends: no step reduces its residual."""
CLOSE = 1e-9
"""Residual [m, or rad times the length of the arm] that counts as reached."""
SEEDS = (-1.0, 0.0, 1.0)
"""Shifts [rad] of the desired angles at which the search for the first pose begins."""
SHIFTED = 5
"""Joints that are shifted: the last turns about the tool."""
LONGEST = 0.5
"""Longest step of a joint [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class Reached:
    """Angles (n, k) [rad] nearest to poses, and the residual distances `missing` (n,) [m]."""

    angles: Array
    missing: Array

    @property
    def within(self) -> NDArray[np.bool_]:
        """Whether each pose is reached."""
        return self.missing <= CLOSE


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
        rows = np.flatnonzero((np.linalg.norm(r, axis=1) > 0.01 * CLOSE) & (damping < HOPELESS))
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
    longest = np.maximum(np.abs(step).max(axis=1, keepdims=True) / LONGEST, 1.0)
    return np.asarray(step / longest)


def over_cell(chain: Chain, position: Array, turn: Array, near: Array, low: Array, high: Array) -> Reached:
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
