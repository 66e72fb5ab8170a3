"""Quantiles, over units, of quantities that depend on angles, Gaussian or as a sample has them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy
from scipy.special import ndtri

from ...arrays import Array

DIRECTIONS = 64
NEWTON_STEPS = 30
CHUNK = 2**21
"""Numbers of a sample held at once."""


def radius_quantile(covariance: Array, coverage: float) -> Array:
    """Radius (...) that a centred Gaussian vector in the plane keeps with probability `coverage`.

    `covariance` (..., 2, 2) with eigenvalues l_1, l_2: P(R > r) is the mean over phi of
    exp(-r^2 / (2 s)), s = l_1 cos^2 phi + l_2 sin^2 phi (Hoyt distribution). ln P is convex in
    r^2, so that Newton's method approaches the radius from below, from the quantile of the widest
    direction.
    """
    values = np.maximum(np.linalg.eigvalsh(covariance), 0.0)
    scale = values[..., 1]
    ratio = np.where(scale > 0.0, values[..., 0] / np.where(scale > 0.0, scale, 1.0), 0.0)
    angle = np.pi * (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
    rate = 0.5 / (np.cos(angle) ** 2 + ratio[..., None] * np.sin(angle) ** 2)
    square = np.full(ratio.shape, ndtri(0.5 * (1.0 + coverage)) ** 2)
    for _ in range(NEWTON_STEPS):
        exceedances = np.exp(-rate * square[..., None])
        total = exceedances.sum(axis=-1)
        level = np.log(total / DIRECTIONS) - np.log1p(-coverage)
        square = square + level * total / np.sum(rate * exceedances, axis=-1)
    return np.asarray(np.sqrt(square * scale))


def normals(count: int, dimensions: int, seed: int = 0) -> Array:
    """A scrambled Sobol sample of independent standard normals (count, dimensions)."""
    bits = int(np.ceil(np.log2(max(count, 2))))
    points = scipy.stats.qmc.Sobol(dimensions, rng=np.random.default_rng(seed)).random_base2(bits)
    return np.asarray(ndtri(np.clip(points[:count], 1e-12, 1.0 - 1e-12)))


def root(covariance: Array) -> Array:
    """A with A A' = covariance, shape (..., k, k), also where it is singular: standard deviations
    times the symmetric root of the correlations, to the same precision in every row and on every
    processor, whatever the units of the rows and however often an eigenvalue occurs.
    """
    scale = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))[..., None]
    over = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / over / np.swapaxes(over, -1, -2))
    part = vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]
    return np.asarray(scale * (part @ np.swapaxes(vectors, -1, -2)))


def sample_quantile(covariance: Array, sample: Array, of: Callable[[Array], Array], coverage: float) -> Array:
    """Quantile (n,) over `sample` (s, k) standard normals of `of` (..., k) -> (...).

    `covariance` (n, k, k) is that of the argument of `of`.
    """
    return quantile_over(root(covariance), sample, of, coverage)


def quantile_over(factors: Array, sample: Array, of: Callable[[Array], Array], coverage: float) -> Array:
    """Quantile (n,) over `sample` (s, m) of standardised sources of `of` (..., k) -> (...).

    `factors` (n, k, m) take the sources to the argument of `of`. Designs are taken in chunks, so
    that memory does not grow with n.
    """
    step = max(1, CHUNK // sample.size)
    quantiles = [
        np.quantile(of(sample @ np.swapaxes(part, -1, -2)), coverage, axis=-1)
        for part in np.split(factors, range(step, len(factors), step))
    ]
    return np.concatenate(quantiles)
