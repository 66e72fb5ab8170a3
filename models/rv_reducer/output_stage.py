"""Backlash of the output mechanism: play of the crank-arm bearings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .geometry import RvGeometry

Array = NDArray[np.float64]


def backlash_zone(geometry: RvGeometry, clearance: Array) -> tuple[Array, Array]:
    """Mid value and half-width [rad] of phi_3 = du/a_0 for du in [0, clearance] [m]."""
    half = 0.5 * clearance / geometry.centre_distance
    return half, half
