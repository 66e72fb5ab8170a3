"""Backlash of the output mechanism: play of the crank-arm bearings."""

from __future__ import annotations

from ..inputs.distribution import Array
from .geometry import RvGeometry


def backlash_zone(geometry: RvGeometry, clearance: Array) -> tuple[Array, Array]:
    """Mid value and half-width [rad] of phi_3 = du/a_0 for du in [0, clearance] [m]."""
    half = 0.5 * clearance / geometry.centre_distance
    return half, half
