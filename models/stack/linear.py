"""The linearised stack: worst case, root sum square, mean shifts and contributions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from ...arrays import Array
from .made import Tolerances, limit_of, mean_of, spread_of
from .mechanism import Mechanism

SIGMAS = 3.0
"""Standard deviations in a root-sum-square variation: t of a normal part with Cp = 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Linear:
    """y = centre + sum_i S_i t z_i by parts, per unit of tolerance.

    `worst` (p,) is sum |S_i| over the pieces of a part, `mean` (p,) the sum of S_i E[z_i], `shift`
    (p,) the sum of |S_i E[z_i]|, `covariance` (p, p) that of y's contributions at t = 1, `slope`
    (p,) the sum of S_i, by which y follows the mean of a part that is `AsMade`. All results are in
    the unit of the requirement; designs t have shape (n, p), and so have derivatives, which are by
    the spread of parts that are `AsMade`.
    """

    worst: Array
    mean: Array
    shift: Array
    covariance: Array
    slope: Array

    def worst_case(self, t: Tolerances) -> Array:
        """sum_i |S_i| t: no unit of parts within their zones deviates more."""
        return np.asarray(limit_of(t) @ self.worst)

    def variance(self, t: Tolerances) -> Array:
        """Variance of y (n,)."""
        s = spread_of(t)
        return np.asarray(np.sum((s @ self.covariance) * s, axis=1))

    def rss(self, t: Tolerances) -> Array:
        """Three standard deviations of y; for normal parts with Cp = 1 sqrt(sum (S_i t)^2)."""
        return SIGMAS * np.sqrt(np.maximum(self.variance(t), 0.0))

    def shifted_rss(self, t: Tolerances) -> Array:
        """Mean shifts in the worst direction plus the root sum square.

        sum |S_i| |E[x_i]| + rss, E[x_i] = t E[z_i]. Reference: Chase & Greenwood (1988), Design
        issues in mechanical tolerance analysis, Manufacturing Review 1(1), 50-59 (estimated mean
        shift), with Cp.
        """
        return spread_of(t) @ self.shift + np.abs(mean_of(t)) @ self.worst + self.rss(t)

    def mean_shift(self, t: Tolerances) -> Array:
        """Mean of y minus its value at the mid-limits (n,)."""
        return np.asarray(spread_of(t) @ self.mean + mean_of(t) @ self.slope)

    def rss_slopes(self, t: Tolerances) -> Array:
        """d rss / d t, shape (n, p); 0 where there is no spread at all."""
        rss = self.rss(t)[:, None]
        along = SIGMAS**2 * (spread_of(t) @ self.covariance)
        return np.divide(along, rss, out=np.zeros_like(along), where=rss > 0.0)

    def within(self, t: Tolerances, lower: Array, upper: Array) -> Array:
        """Fraction of units (n,) between limits, as if y were normal.

        `lower` and `upper` (n,) are those of y minus its value at the mid-limits, or infinite.
        """
        std, shift = self.rss(t) / SIGMAS, self.mean_shift(t)
        safe = np.where(std > 0.0, std, 1e-300)
        return np.asarray(ndtr((upper - shift) / safe) - ndtr((lower - shift) / safe))

    def yield_slopes(self, t: Tolerances, lower: Array, upper: Array) -> Array:
        """d/dt of the fraction of units between limits, as if y were normal, shape (n, p).

        `lower` and `upper` (n,) are those of y minus its value at the mid-limits, or infinite.
        """
        std = self.rss(t)[:, None] / SIGMAS
        safe, shift = np.where(std > 0.0, std, 1.0), self.mean_shift(t)[:, None]
        slopes = np.zeros_like(spread_of(t))
        for sign, limit in ((1.0, upper), (-1.0, lower)):
            z = (np.where(np.isfinite(limit), limit, 0.0)[:, None] - shift) / safe
            density = np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi) * np.isfinite(limit)[:, None]
            slopes -= sign * density * (self.mean + z * self.rss_slopes(t) / SIGMAS) / safe
        return np.where(std > 0.0, slopes, 0.0)

    def variance_shares(self, t: Tolerances) -> Array:
        """Fraction of each part in the variance (n, p); a negative fraction compensates others."""
        return _fractions(spread_of(t) * (spread_of(t) @ self.covariance))

    def worst_shares(self, t: Tolerances) -> Array:
        """Fraction of each part in the worst case (n, p)."""
        return _fractions(limit_of(t) * self.worst)


def _fractions(contributions: Array) -> Array:
    """Fractions (n, p) that add up to 1, or are 0 where the total is 0."""
    total: Array = contributions.sum(axis=1)[:, None]
    return np.divide(contributions, total, out=np.zeros_like(contributions), where=total > 0.0)


def linearised(mechanism: Mechanism) -> Linear:
    """The linear model about the mid-limits."""
    parts = np.arange(len(mechanism.inputs))
    moments = np.array([distribution.raw_moments(2) for distribution in mechanism.inputs])
    mean, std = moments[:, 1], np.sqrt(np.maximum(moments[:, 2] - moments[:, 1] ** 2, 0.0))
    owners, slope = mechanism.owners, mechanism.sensitivities
    of_part = (owners == parts[:, None]).astype(float)
    pieces = len(owners)
    correlation = np.eye(pieces) if mechanism.correlation is None else mechanism.correlation
    scaled = of_part * (slope * std[owners])
    return Linear(
        worst=of_part @ np.abs(slope),
        mean=of_part @ (slope * mean[owners]),
        shift=of_part @ np.abs(slope * mean[owners]),
        covariance=scaled @ correlation @ scaled.T,
        slope=of_part @ slope,
    )
