"""Small vector algebra on the last axis, in batches.

Vectors have their components apart in memory (the last axis is the slowest): every operation then
runs over whole batches, several times faster than over triples.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Array


def vector(x: Array | float, y: Array | float, z: Array | float) -> Array:
    """Vectors (..., 3) of components that broadcast."""
    return np.moveaxis(np.stack(np.broadcast_arrays(x, y, z)).astype(np.float64, copy=False), 0, -1)


def dot(a: Array, b: Array) -> Array:
    """Scalar products (...) of vectors (..., 3)."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def cross(a: Array, b: Array) -> Array:
    """Vector products (..., 3)."""
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


def solved(rows: Array, right: Array) -> Array:
    """Solutions x (..., 3) of rows (..., 3, 3) . x = right (..., 3), by Cramer's rule."""
    adjugate, two, three = cofactors(rows)
    determinant = dot(rows[..., 0, :], adjugate)[..., None]
    total = right[..., 0, None] * adjugate + right[..., 1, None] * two + right[..., 2, None] * three
    return total / determinant


def cofactors(rows: Array) -> tuple[Array, Array, Array]:
    """Columns (..., 3) of the inverse of rows (..., 3, 3), times the determinant."""
    a, b, c = rows[..., 0, :], rows[..., 1, :], rows[..., 2, :]
    return cross(b, c), cross(c, a), cross(a, b)


def rotation_vector(frame: Array) -> Array:
    """Rotation vectors (..., 3) [rad] below pi, of turned unit vectors (..., 3 axes, 3)."""
    x, y, z = frame[..., 0, :], frame[..., 1, :], frame[..., 2, :]
    part = 0.5 * vector(y[..., 2] - z[..., 1], z[..., 0] - x[..., 2], x[..., 1] - y[..., 0])
    sine = np.sqrt(dot(part, part))
    cosine = 0.5 * (x[..., 0] + y[..., 1] + z[..., 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    return part * np.where(sine > 0.0, angle / np.where(sine > 0.0, sine, 1.0), 1.0)[..., None]
