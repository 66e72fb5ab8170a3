"""Target clearances of the tooth modification over the profile angle phi in [0, pi].

Document B names its target (near-conjugate, uniform load, adequate lubrication) but prints neither
its numbers nor the band of angles in which it counts: both are inputs here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .geometry import RvGeometry

Band = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """Target clearance [m] at profile angles [rad] and the weights of the angles; all (n + 1,).

    An angle of weight 0 is not in the sum, but the constraints hold there.
    """

    phi: Array
    clearance: Array
    weight: Array


def angles(intervals: int) -> Array:
    """The n + 1 profile angles [rad], evenly spaced over [0, pi]."""
    return np.linspace(0.0, np.pi, intervals + 1)


def within(phi: Array, band: Band) -> Array:
    """Weight 1 where phi lies in the band [rad], ends included, else 0."""
    slack = 1e-9
    return np.where((phi >= band[0] - slack) & (phi <= band[1] + slack), 1.0, 0.0)


def film(phi: Array, thickness: float, band: Band) -> Target:
    """A lubrication film of one thickness [m] over a band [rad]; elsewhere there is no target."""
    return Target(phi, np.full_like(phi, thickness), within(phi, band))


def near_conjugate(geometry: RvGeometry, phi: Array, rotation: float, radial_gap: float, band: Band) -> Target:
    """The rotation-modified profile with relief at tip and root, at all angles.

    Turning by `rotation` [rad] opens e z_c rotation sin(phi)/sqrt(S): all teeth touch together once
    the disc has turned back. Outside of the working band [rad] a parabolic relief, an assumption,
    grows to the radial gap [m] at root (phi = 0) and tip (phi = pi).
    """
    root = np.sqrt(1.0 + geometry.k1**2 - 2.0 * geometry.k1 * np.cos(phi))
    open_flank = geometry.lever * rotation * np.sin(phi) / root
    start, end = band
    below = np.clip((start - phi) / max(start, 1e-12), 0.0, 1.0)
    above = np.clip((phi - end) / max(np.pi - end, 1e-12), 0.0, 1.0)
    relief = radial_gap * (below**2 + above**2)
    return Target(phi, open_flank + relief, np.ones_like(phi))


def table(phi: Array, at: Array, clearance: Array) -> Target:
    """A table of the user: clearance [m] at rising angles `at` [rad], straight in between.

    Angles outside of the table are omitted. Raises ValueError where the angles do not rise.
    """
    if not np.all(np.diff(at) > 0.0):
        raise ValueError(f"the angles of a clearance table must rise, got {at}")
    inside = within(phi, (float(at[0]), float(at[-1])))
    return Target(phi, np.interp(phi, at, clearance), inside)
