"""Length of a centred Gaussian vector in space: how often it exceeds a bound, and its quantiles.

With the variances l_1 >= l_2 >= l_3 along the principal axes, the square of the two smaller
components together is s(phi) = l_2 cos^2 phi + l_3 sin^2 phi times an exponential variable of mean
2, phi uniform. At a given phi the integral over the largest component has a closed form, and one
integral remains:

    P(|v| > r) = erfc(a) + (2/sqrt pi) exp(-a^2) mean over phi of D(a sqrt k)/sqrt k,
    a = r/sqrt(2 l_1),  k = l_1/s(phi) - 1,  D Dawson's function.

The length of one component is half-normal (l_2 = l_3 = 0), that of two equal ones Rayleigh's, of
two unequal ones Hoyt's, and of three equal ones Maxwell's.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri, dawsn, erfc, ndtri

from ..arrays import Array
from .roots import bracketed_roots

ANGLES = 16
"""Midpoints of phi in a quarter turn: the error of P is up to 1e-6 from r = sqrt(l_1) on, and up to
1e-4 below."""
LEAST, MOST = 1e-14, 1e300
"""Range of k: below it D(a sqrt k)/sqrt k is a to rounding; beyond it one component counts."""


def principal(covariance: Array) -> Array:
    """Principal variances (..., 3), largest first, of covariances (..., c, c), c = 1, 2 or 3."""
    size = covariance.shape[-1]
    variances = np.zeros((*covariance.shape[:-2], 3))
    if size == 2:  # in closed form: many times faster
        a, b, d = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
        largest = 0.5 * (a + d) + np.hypot(0.5 * (a - d), b)
        safe = np.where(largest > 0.0, largest, 1.0)
        variances[..., 0], variances[..., 1] = largest, (a * d - b * b) / safe
    else:
        variances[..., :size] = np.linalg.eigvalsh(covariance)[..., ::-1]
    return np.maximum(variances, 0.0)


def exceedance(variances: Array, length: Array | float) -> Array:
    """P(|v| > r), shape (...), of principal variances (..., 3), largest first, and r > 0, (...)."""
    largest = np.maximum(variances[..., 0], np.finfo(float).tiny)
    a = np.asarray(length) / np.sqrt(2.0 * largest)
    probability = erfc(a)
    if np.any(variances[..., 1] > 0.0):
        phi = 0.5 * np.pi * (np.arange(ANGLES) + 0.5) / ANGLES
        s = variances[..., 1, None] * np.cos(phi) ** 2 + variances[..., 2, None] * np.sin(phi) ** 2
        with np.errstate(divide="ignore"):
            root = np.sqrt(np.clip(largest[..., None] / s - 1.0, LEAST, MOST))
        integrand = dawsn(np.minimum(a[..., None] * root, MOST)) / root
        probability += 2.0 / np.sqrt(np.pi) * np.exp(-(a**2)) * np.mean(integrand, axis=-1)
    return np.asarray(probability)


def quantile(variances: Array, coverage: float) -> Array:
    """Length (...) that v does not exceed with the probability `coverage`.

    The variances are those of `exceedance`. The length lies between those of one component and of three equal ones.
    """
    scale = np.sqrt(variances[..., 0])
    relative = variances / np.where(scale > 0.0, scale, 1.0)[..., None] ** 2

    def excess(length: Array, second: Array, third: Array) -> Array:
        parts = np.stack([np.ones_like(second), second, third], axis=-1)
        return exceedance(parts, length) - (1.0 - coverage)

    low, high = ndtri(0.5 * (1.0 + coverage)), np.sqrt(chdtri(3.0, 1.0 - coverage))
    bracket = np.full(scale.shape, 0.999 * low), np.full(scale.shape, 1.001 * high)
    roots = bracketed_roots(excess, bracket, relative[..., 1], relative[..., 2])
    return np.asarray(scale * roots.x)
