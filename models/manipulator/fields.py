"""Pose errors of machines over poses, to first order: a linear map of independent normal sources.

A machine has one error per source and keeps it at every pose, so that its pose errors at different
poses are dependent; the spread over machines at one pose needs the covariance there alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ..gaussian_length import exceedance, principal, quantile

Rows = NDArray[np.int64]
EQUAL = 1e-9
"""Relative difference of two probabilities that counts as equal."""


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """A pose error of c = 1, 2 or 3 components at poses: `effects` (poses, c, sources), per unit
    of each source.
    """

    effects: Array

    def at(self, poses: Rows | slice) -> Field:
        """The same error at some of the poses."""
        return Field(self.effects[poses])

    def variances(self, sigma: Array) -> Array:
        """Principal variances (n, poses, 3) over machines, of standard deviations (n, sources)."""
        poses, size, sources = self.effects.shape
        products = self.effects[:, :, None, :] * self.effects[:, None, :, :]
        covariance = sigma**2 @ products.reshape(-1, sources).T
        return principal(covariance.reshape(len(sigma), poses, size, size))


def worst_deviation(variances: Array) -> Array:
    """Largest root mean square length (n,) over poses, of principal variances (n, poses, 3)."""
    return np.asarray(np.sqrt(variances.sum(axis=-1).max(axis=-1)))


def worst_exceedance(variances: Array, bound: float) -> tuple[Array, Rows]:
    """Largest P(length > bound) (n,) over poses, and the pose (n,) where it is."""
    probabilities = exceedance(variances, bound)
    at = np.argmax(probabilities, axis=1)
    return probabilities[np.arange(len(probabilities)), at], at


def worst_quantile(variances: Array, coverage: float) -> tuple[Array, Rows]:
    """Largest quantile (n,) of the length over poses, and the pose (n,) where it is.

    A pose has a larger quantile than another where its error exceeds the quantile of the other with
    a probability above 1 - coverage. The widest axis of all poses alone, half-normal, gives a lower
    bound of the worst quantile: only poses that exceed it too often are examined again.
    """
    rows, missed = np.arange(len(variances)), (1.0 - coverage) * (1.0 + EQUAL)
    axis = np.zeros((len(variances), 3))
    axis[:, 0] = variances[..., 0].max(axis=1)
    over = exceedance(variances, quantile(axis, coverage)[:, None])
    at = np.argmax(over, axis=1)
    while True:
        bound = quantile(variances[rows, at], coverage)
        remaining = over > missed
        remaining[rows, at] = False
        if not np.any(remaining):
            return bound, at
        over = np.zeros_like(over)
        over[remaining] = exceedance(variances[remaining], bound[np.nonzero(remaining)[0]])
        worst = np.argmax(over, axis=1)
        at = np.where(over[rows, worst] > missed, worst, at)
