"""Global sensitivity of the pose to its error sources, over the task ring."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...arrays import Array
from .geometry import Manipulator, TaskRing
from .maps import first_order
from .sources import NAMES, Combination, matrix

Index = Literal["plane", "volume", "rms_plane", "rms_volume"]
INDICES: tuple[Index, ...] = ("plane", "volume", "rms_plane", "rms_volume")
"""Means over the rectangle in the rz plane (the document's), over the ring (weight r), and the
root mean squares of both."""
ORDER = 24
"""Nodes per axis of Gauss-Legendre quadrature, at first."""
FINEST = 192
"""Nodes per axis at most: an effect that changes its sign within the ring has a kink in its size,
on which the quadrature converges slowly."""
CLOSE = 1e-3
"""Relative change by doubling the nodes at which an index counts as converged."""
GRID = 41
"""Nodes per axis of a grid of all poses."""


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """Global indices of sources or combinations (m,), in the order of `names`.

    `squareness` sqrt(dth_r^2 + dth_t^2) and `yaw` |dth_z| [rad], `position` |dP| [m], each per
    metre or radian of the source. `error` is the largest relative change by the last doubling of
    the quadrature's `order`.
    """

    names: tuple[str, ...]
    squareness: Array
    yaw: Array
    position: Array
    error: float
    order: int

    def contributions(self, output: str, sigma: Array | float = 1.0) -> Array:
        """Contributions (m,) [percent] to the variance of `output` ("squareness", "yaw",
        "position") of sources with the standard deviations `sigma` (m,) [m, rad].
        """
        part = np.asarray(getattr(self, output) * sigma) ** 2
        total = part.sum()
        return 100.0 * part / total if total > 0.0 else np.zeros_like(part)


def quadrature(ring: TaskRing, index: Index, order: int = ORDER) -> tuple[Array, Array, Array]:
    """Gauss-Legendre nodes r, z [m] and weights (sum 1), each (order^2,), of a mean."""
    x, gauss = np.polynomial.legendre.leggauss(order)
    r, z = (lo + 0.5 * (hi - lo) * (x + 1.0) for lo, hi in (ring.r, ring.z))
    weight = np.outer(gauss * (r if index.endswith("volume") else 1.0), gauss)
    r, z = np.meshgrid(r, z, indexing="ij")
    return r.ravel(), z.ravel(), (weight / weight.sum()).ravel()


def grid(ring: TaskRing, count: int = GRID) -> tuple[Array, Array]:
    """Poses r, z (count^2,) [m] on a regular grid that includes the ring's edges."""
    r, z = np.meshgrid(np.linspace(*ring.r, count), np.linspace(*ring.z, count), indexing="ij")
    return r.ravel(), z.ravel()


def sensitivity(
    manipulator: Manipulator,
    ring: TaskRing,
    index: Index = "plane",
    combinations: Mapping[str, Combination] | None = None,
    order: int = ORDER,
) -> Sensitivity:
    """Indices of the `combinations`, or of all 63 sources; the order doubles until they are CLOSE.

    Raises OutOfReach.
    """
    names = NAMES if combinations is None else tuple(combinations)
    columns = None if combinations is None else matrix(combinations)
    coarse = _means(manipulator, ring, index, columns, max(1, order // 2))
    while True:
        fine = _means(manipulator, ring, index, columns, order)
        error = _change(fine, coarse)
        if error <= CLOSE or 2 * order > FINEST:
            return Sensitivity(names, fine[0], fine[1], fine[2], error, order)
        coarse, order = fine, 2 * order


def _change(fine: Array, coarse: Array) -> float:
    """Largest relative change; values below rounding of the largest of their row count as zero."""
    floor = 1e-9 * fine.max(axis=1, keepdims=True)
    size = np.maximum(np.maximum(fine, floor), np.finfo(float).tiny)
    return float(np.max(np.abs(fine - coarse) / size))


def _means(manipulator: Manipulator, ring: TaskRing, index: Index, columns: Array | None, order: int) -> Array:
    """Means (3, m) of squareness, yaw and position."""
    r, z, weight = quadrature(ring, index, order)
    maps = first_order(manipulator, r, z)
    turn, move = maps.orientation, maps.position
    if columns is not None:
        turn, move = turn @ columns, move @ columns
    sizes = np.stack([np.hypot(turn[:, 0], turn[:, 1]), np.abs(turn[:, 2]), np.linalg.norm(move, axis=1)])
    if index.startswith("rms"):
        return np.sqrt(np.tensordot(sizes**2, weight, axes=(1, 0)))
    return np.tensordot(sizes, weight, axes=(1, 0))
