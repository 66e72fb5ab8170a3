"""Nominal geometry of the loaded contact: the modified profile around one pin, exactly.

Everything around a pin is expressed in axes that point from the housing's centre to the pin (real
part) and counter-clockwise (imaginary part). With phi the angle from the pin to the eccentric, the
pin's centre relative to that of the disc is r_p - e exp(i phi), and the curve that it must follow
is C(v) = (r_p + dr_p) exp(i v) - e exp(i (phi + z_p v)); the tooth is its inner parallel curve at
r_rp + dr_rp. The gap is the distance of the pin's centre from C plus dr_rp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....arrays import Array, Complex
from ..geometry import RvGeometry

_SPACING = 1e-3
"""Spacing [rad] of the points of C from which its nearest point is sought."""
_BOTTOM = 0.9
"""Cosine of the phase above which C may have two nearest points."""


@dataclass(frozen=True, slots=True)
class ContactGeometry:
    """Nominal parts: lengths in metres; the modification of document B by default.

    Two cranks and two discs are assumptions, as in document A. Lever arms are those of the modified
    profile's own normals; without `true_levers` e z_c sin(phi)/sqrt(S), those of the unmodified
    profile, 1 % different where pins are loaded (7 % near the bottom of a tooth space), which puts
    0.7 % on peak force and wind-up. Without an `involute_stage` the cranks are the input.
    """

    nominal: RvGeometry = RvGeometry()
    dr_rp: float = -40e-6
    dr_p: float = -70e-6
    discs: int = 2
    cranks: int = 2
    true_levers: bool = True
    involute_stage: bool = True

    @property
    def pins(self) -> int:
        """Number of pins."""
        return self.nominal.pins

    @property
    def output_ratio(self) -> float:
        """b'/b: turn of a disc against its mesh per turn of the carrier with the input held.

        With the sun held it is that of the nominal geometry, 121/117 for the RV-40E. With the
        cranks held they are at rest in the housing, as is the mesh, and it is 1.
        """
        return self.nominal.output_ratio if self.involute_stage else 1.0

    @property
    def pin_angles(self) -> Array:
        """Angles [rad] of the pins in the housing, (pins,)."""
        return 2.0 * np.pi * np.arange(self.pins) / self.pins

    @property
    def disc_angles(self) -> Array:
        """Angles [rad] of the discs' eccentrics, and of the discs, against the first, (discs,)."""
        return 2.0 * np.pi * np.arange(self.discs) / self.discs

    def phase(self, angles: Array) -> Array:
        """Angle phi [rad] from each pin to the eccentric, (angles, discs, pins)."""
        eccentric = angles[:, None] + self.disc_angles
        return np.asarray(eccentric[:, :, None] - self.pin_angles)


def unit(angle: Array) -> Complex:
    """exp(i angle)."""
    return np.asarray(np.exp(1j * angle), dtype=np.complex128)


@dataclass(frozen=True, slots=True)
class Curve:
    """C and its first three derivatives by v, and exp(i v)."""

    point: Complex
    first: Complex
    second: Complex
    third: Complex
    radial: Complex


def curve(geometry: ContactGeometry, phi: Array, v: Array, shift: Array | float = 0.0) -> Curve:
    """The curve C at v around a pin at phase phi, with a deviation of the shift modification."""
    nominal = geometry.nominal
    radial = unit(v)
    big = (nominal.pin_circle_radius + geometry.dr_p + shift) * radial
    small = nominal.eccentricity * unit(phi + nominal.pins * v)
    first = np.multiply(1j, big - nominal.pins * small, dtype=np.complex128)
    second = nominal.pins**2 * small - big
    third = np.multiply(1j, nominal.pins**3 * small - big, dtype=np.complex128)
    return Curve(big - small, first, second, third, radial)


def foot(geometry: ContactGeometry, phi: Array, pin: Complex, shift: Array | float = 0.0) -> Array:
    """Parameter v of the point of C nearest to `pin`.

    Newton's method from the nearest of a few points: close to the bottom of a tooth space C is bent
    inwards with a radius below a tenth of a millimetre, and a pin's centre may have two feet.
    Raises ArithmeticError where it does not settle: errors far beyond a tooth's radius.
    """
    nearest = _nearest_start(geometry, phi, pin, shift)
    v, phi, pin, shift = (np.broadcast_to(array, nearest.shape).ravel() for array in (nearest, phi, pin, shift))
    unsettled, nearest_flat = np.arange(v.size), nearest.reshape(-1)
    for _ in range(100):
        at = curve(geometry, phi, v, shift)
        away = pin - at.point
        speed = np.abs(at.first) ** 2
        slope = speed - np.real(away * at.second.conj())
        # downhill also where the distance is not convex
        step = np.real(away * at.first.conj()) / np.maximum(np.abs(slope), 2e-3 * speed)
        v = v + np.clip(step, -_SPACING, _SPACING)
        nearest_flat[unsettled] = v
        moving = np.abs(step) >= 1e-11
        if not np.any(moving):
            return nearest
        unsettled, v, phi, pin, shift = unsettled[moving], v[moving], phi[moving], pin[moving], shift[moving]
    raise ArithmeticError("Newton's method reaches no nearest point of the profile; the errors are too large")


def _nearest_start(geometry: ContactGeometry, phi: Array, pin: Complex, shift: Array | float) -> Array:
    """Parameter of the nearest of a few points of C; more than one only at bottoms of spaces."""
    nearest = np.zeros(np.broadcast_shapes(phi.shape, pin.shape, np.shape(shift)))
    bottom = np.broadcast_to(np.cos(phi) > _BOTTOM, nearest.shape)
    phi, pin, shift = (np.broadcast_to(array, nearest.shape)[bottom] for array in (phi, pin, shift))
    v = nearest[bottom]
    least = np.abs(pin - curve(geometry, phi, v, shift).point)
    for start in _SPACING * np.array([-4, -3, -2, -1, 1, 2, 3, 4]):
        distance = np.abs(pin - curve(geometry, phi, np.full_like(v, start), shift).point)
        v, least = np.where(distance < least, start, v), np.minimum(distance, least)
    nearest[bottom] = v
    return nearest


def nominal_pin(geometry: ContactGeometry, phi: Array) -> Complex:
    """Centre of a pin relative to the disc's centre, in the pin's axes [m]."""
    nominal = geometry.nominal
    return nominal.pin_circle_radius - nominal.eccentricity * unit(phi)


def lever(geometry: ContactGeometry, phi: Array) -> Array:
    """Lever arm e z_c sin(phi)/sqrt(S) [m] of the unmodified profile."""
    k1 = geometry.nominal.k1
    root = np.sqrt(1.0 + k1**2 - 2.0 * k1 * np.cos(phi))
    return np.asarray(geometry.nominal.lever * np.sin(phi) / root)
