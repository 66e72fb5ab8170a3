"""Accuracy of attained positions: the measures of ISO 9283, and their bidirectional extension.

ISO 9283:1998 (quoted after secondary sources) defines the pose accuracy AP, the distance from the
command to the mean attained from one approach; the repeatability RP; the multi-directional
variation vAP of three approaches; path accuracy AT. Repeatability, the figure of data sheets, does
not depend on tolerances. The bidirectional pose accuracy is the quantile of the
error over units, sides of approach, phases of waves, and poses.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from ...arrays import Array

COVERAGE = 0.9973


def pose_accuracy(attained: Array, command: Array) -> Array:
    """AP (...): distance from `command` (..., 3) to the mean of `attained` (..., repeats, 3)."""
    return np.asarray(np.linalg.norm(attained.mean(axis=-2) - command, axis=-1))


def repeatability(attained: Array) -> Array:
    """RP (...) of `attained` (..., repeats, 3): mean + 3 s of the distances to their mean.

    s is the sample standard deviation; at least two repeats are needed.
    """
    distance = np.linalg.norm(attained - attained.mean(axis=-2, keepdims=True), axis=-1)
    return np.asarray(distance.mean(axis=-1) + 3.0 * distance.std(axis=-1, ddof=1))


def multi_directional_variation(attained: Array) -> Array:
    """vAP (...) of `attained` (..., approaches, repeats, 3): the largest distance of two means."""
    mean = attained.mean(axis=-2)
    pairs = combinations(range(mean.shape[-2]), 2)
    apart = [np.linalg.norm(mean[..., i, :] - mean[..., j, :], axis=-1) for i, j in pairs]
    return np.asarray(np.max(apart, axis=0))


def path_accuracy(attained: Array, command: Array) -> Array:
    """AT (...): the largest distance of the mean path from the commanded one along it.

    `attained` (..., repeats, points, 3), `command` (points, 3).
    """
    return np.asarray(np.linalg.norm(attained.mean(axis=-3) - command, axis=-1).max(axis=-1))


def path_repeatability(attained: Array) -> Array:
    """RT (...) of `attained` (..., repeats, points, 3): the largest RP of a point of the path."""
    return np.asarray(repeatability(np.swapaxes(attained, -3, -2)).max(axis=-1))


def bidirectional(errors: Array, coverage: float = COVERAGE) -> tuple[float, float]:
    """A and R of errors (n, 3): the quantile of their length at the coverage, and its rms."""
    length = np.linalg.norm(errors, axis=-1)
    quantile = np.quantile(length, coverage, method="weibull")
    return float(quantile), float(np.sqrt(np.mean(length**2)))
