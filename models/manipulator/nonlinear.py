"""The first-order maps against the exact pose, by quasi-Monte Carlo."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from scipy.special import ndtri

from ...arrays import Array
from .forward import exact_pose
from .geometry import Manipulator, TaskRing
from .indices import Index
from .maps import first_order
from .sources import NAMES

BLOCK = 4096


@dataclass(frozen=True, slots=True)
class Nonlinearity:
    """Root mean squares over the ring and over machines with random errors.

    `position` [m] and `orientation` [rad] of the exact pose error; `position_off` and
    `orientation_off` of the residuals of the first-order maps, in the same units.
    """

    position: float
    orientation: float
    position_off: float
    orientation_off: float


def nonlinearity(
    manipulator: Manipulator,
    ring: TaskRing,
    sigma: Array,
    rng: np.random.Generator,
    samples: int = 4096,
    index: Index = "plane",
) -> Nonlinearity:
    """Scrambled Sobol sample (rounded up to a power of two) of poses, and of machines whose errors
    are normal with the standard deviations `sigma` (63,) [m, rad].

    Raises OutOfReach and NoPose.
    """
    power = int(np.ceil(np.log2(max(2, samples))))
    points = scipy.stats.qmc.Sobol(3 + len(NAMES), scramble=True, rng=rng).random_base2(power)
    r, z, phi = _poses(ring, points, index)
    errors = sigma * ndtri(np.clip(points[:, 3:], 1e-16, 1.0 - 1e-16))
    exact = exact_pose(manipulator, r, z, phi, errors)
    off_position, off_turn = exact.position.copy(), exact.orientation.copy()
    for first in range(0, len(points), BLOCK):
        at = slice(first, first + BLOCK)
        maps = first_order(manipulator, r[at], z[at], phi[at])
        off_position[at] -= (maps.position @ errors[at, :, None])[..., 0]
        off_turn[at] -= (maps.orientation @ errors[at, :, None])[..., 0]
    return Nonlinearity(_rms(exact.position), _rms(exact.orientation), _rms(off_position), _rms(off_turn))


def _poses(ring: TaskRing, points: Array, index: Index) -> tuple[Array, Array, Array]:
    (low, high), (bottom, top) = ring.r, ring.z
    r = low + (high - low) * points[:, 0]
    if index.endswith("volume"):
        r = np.sqrt(low**2 + (high**2 - low**2) * points[:, 0])
    return r, bottom + (top - bottom) * points[:, 1], 2.0 * np.pi * points[:, 2]


def _rms(v: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(v**2, axis=-1))))
