"""Which combinations of the sources measured poses identify, and which they do not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...arrays import Array
from .geometry import Manipulator
from .maps import first_order
from .sources import NAMES, SCALES, Combination, matrix

TOLERANCE = 1e-9
"""Singular value, relative to the largest, below which a direction is not identifiable."""


@dataclass(frozen=True, slots=True)
class Identifiable:
    """Directions in the space of the sources `names` (m,), from a singular value decomposition.

    `combinations` (rank, m) change the measured errors, `hidden` (m - rank, m) do not; both are
    orthonormal in the sources' units (um, mrad). `singular` (m,) in mm or mrad per unit.
    """

    names: tuple[str, ...]
    singular: Array
    combinations: Array
    hidden: Array

    @property
    def rank(self) -> int:
        """Number of identifiable combinations."""
        return len(self.combinations)


def identifiable(
    manipulator: Manipulator,
    r: Array,
    z: Array,
    phi: Array | float = 0.0,
    measured: Literal["orientation", "position", "pose"] = "pose",
    combinations: Mapping[str, Combination] | None = None,
) -> Identifiable:
    """Identifiability, to first order, of the 63 sources or of `combinations` of them from pose
    errors measured at r, z [m], phi [rad], each (n,). Raises OutOfReach.
    """
    maps = first_order(manipulator, r, z, phi)
    parts = {"orientation": [maps.orientation], "position": [maps.position]}
    stacked = np.concatenate(parts.get(measured, [maps.orientation, maps.position]), axis=1)
    rows = 1e3 * stacked.reshape(-1, len(NAMES))
    names, columns = NAMES, np.diag(SCALES)
    if combinations is not None:
        names, columns = tuple(combinations), SCALES[:, None] * matrix(combinations)
    triangle = np.linalg.qr(rows @ columns, mode="r")  # same null space, far fewer rows
    _, size, directions = np.linalg.svd(triangle)
    singular = np.zeros(len(names))
    singular[: len(size)] = size
    rank = int(np.sum(singular > TOLERANCE * singular[0]))
    return Identifiable(names, singular, directions[:rank], directions[rank:])
