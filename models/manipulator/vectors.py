"""Small vector algebra on the last axis, in batches."""

from __future__ import annotations

import numpy as np

from ..inputs.distribution import Array


def vector(x: Array | float, y: Array | float, z: Array | float) -> Array:
    """Vectors (..., 3) of components that broadcast."""
    return np.stack(np.broadcast_arrays(x, y, z), axis=-1).astype(np.float64, copy=False)


def dot(a: Array, b: Array) -> Array:
    """Scalar products (...) of vectors (..., 3)."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def cross(a: Array, b: Array) -> Array:
    """Vector products (..., 3); several times faster than numpy's on such short axes."""
    return vector(
        a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
        a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
        a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
    )


def turned(v: Array, by: Array) -> Array:
    """exp(by) v: vectors (..., 3) turned by rotation vectors (..., 3) [rad] (Rodrigues)."""
    angle = np.sqrt(dot(by, by))[..., None]
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2  # (1 - cos)/angle^2 without cancellation
    once = cross(by, v)
    return v + first * once + second * cross(by, once)


def rotation_matrix(by: Array) -> Array:
    """exp(by) as matrices (..., 3, 3), of rotation vectors (..., 3) [rad]."""
    columns = turned(np.eye(3), by[..., None, :])
    return np.swapaxes(columns, -1, -2)


def rotation_vector(matrix: Array) -> Array:
    """Rotation vectors (..., 3) [rad] of matrices (..., 3, 3), for angles below pi."""
    part = 0.5 * vector(
        matrix[..., 2, 1] - matrix[..., 1, 2],
        matrix[..., 0, 2] - matrix[..., 2, 0],
        matrix[..., 1, 0] - matrix[..., 0, 1],
    )
    sine = np.sqrt(dot(part, part))
    cosine = 0.5 * (np.trace(matrix, axis1=-2, axis2=-1) - 1.0)
    angle = np.arctan2(sine, cosine)
    return part * np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 1.0)[..., None]
