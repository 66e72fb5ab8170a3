"""Bidirectional pose accuracy of a design by Monte Carlo: its quantile over its rms.

One sample serves all designs. Units are drawn anew at every pose, since the quantile is taken over
units and poses together; the links' errors at a pose are jointly normal.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import ndtri

from ...arrays import Array
from .drives import Drives
from .measures import COVERAGE

POSES = 512
PER_JOINT = 4
"""Dimensions of a joint in addition to its backlash: side, phase, two components of the wave."""


@dataclass(frozen=True, slots=True, eq=False)
class AccuracySample:
    """Units (n,) at poses: `pose` (n,) is the index of the pose in the maps.

    `link` (n, 3) are standard normal, `side` (n, joints) is +1 or -1, `wave` (2, 2, n, joints) the
    cosine and sine of the phase times two standard normal components, `unit` (n, dimensions) in
    (0, 1) is for the reducers' errors.
    """

    pose: NDArray[np.int64]
    link: Array
    side: Array
    wave: Array
    unit: Array

    @classmethod
    def draw(cls, samples: int, poses: int, joints: int, dimensions: int, rng: np.random.Generator) -> AccuracySample:
        """A scrambled Sobol sample, rounded up to a power of two, over `poses` in turn."""
        bits = int(np.ceil(np.log2(max(samples, 2 * poses))))
        points = scipy.stats.qmc.Sobol(3 + PER_JOINT * joints + dimensions, rng=rng).random_base2(bits)
        points = np.clip(points, 1e-12, 1.0 - 1e-12)
        count, n = 3, len(points)
        side = np.where(points[:, count : count + joints] < 0.5, -1.0, 1.0)
        phase = 2.0 * np.pi * points[:, count + joints : count + 2 * joints]
        normal = ndtri(points[:, count + 2 * joints : count + 4 * joints]).reshape(n, joints, 2)
        waves = [[turn * normal[:, :, at] for at in range(2)] for turn in (np.cos(phase), np.sin(phase))]
        return cls(np.arange(n) % poses, ndtri(points[:, :3]), side, np.array(waves), points[:, count + 4 * joints :])

    def joint_errors(self, backlash: Array, wave_root: Array, free: Array) -> Array:
        """q (n, joints) [rad] of units.

        `backlash` (n, joints) with the hysteresis, `wave_root` (joints, 2, 2) a root of the
        covariance of the wave's components [rad], `free` (n, joints) 0 where a flank is held.
        """
        errors = 0.5 * self.side * backlash * free
        for a, b in product(range(2), repeat=2):
            errors += wave_root[:, a, b] * self.wave[a, b]
        return np.asarray(errors)

    def errors(self, drives: Drives, covariance: Array, joint: Array) -> Array:
        """Position errors (n, 3) [m] by the first-order maps.

        `covariance` (poses, 3, 3) [m^2] of the links' position error, `joint` (n, joints) [rad].
        """
        by_links = np.einsum("nij,nj->ni", smooth_root(covariance)[self.pose], self.link)
        return np.asarray(by_links + np.einsum("nij,nj->ni", drives.move[self.pose], joint))


def smooth_root(covariance: Array) -> Array:
    """A with A A' = covariance (..., k, k), lower triangular: it is smooth in the covariance,
    so that similar designs have similar samples. Singular covariances are widened by 1e-12.
    """
    size = np.trace(covariance, axis1=-2, axis2=-1)[..., None, None] * 1e-12 + 1e-60
    return np.linalg.cholesky(covariance + size * np.eye(covariance.shape[-1]))


def ratio(errors: Array, coverage: float = COVERAGE) -> float:
    """c = A/R of errors (n, 3): quantile over rms of their lengths; 1 where all are 0."""
    square = np.sum(errors**2, axis=1)
    rms = float(np.sqrt(square.mean()))
    return float(np.sqrt(np.quantile(square, coverage, method="weibull"))) / rms if rms else 1.0


def sobol_poses(low: tuple[float, ...], high: tuple[float, ...], rng: np.random.Generator, count: int = POSES) -> Array:
    """Poses (count, k) spread evenly between `low` and `high` (k,)."""
    points = scipy.stats.qmc.Sobol(len(low), rng=rng).random_base2(int(np.ceil(np.log2(count))))
    return np.asarray(np.array(low) + points * (np.array(high) - np.array(low)))
