"""Gaps between pins and discs with every part error, at any crank angles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from ....arrays import Array, Complex
from .errors import PartErrors
from .geometry import ContactGeometry, curve, foot, nominal_pin, unit
from .nominal import Nominal


@dataclass(frozen=True, slots=True, eq=False)
class Gaps:
    """The gaps between pins and discs of units x crank angles.

    `gap` (units, angles, discs, pins) [m] is in the normal direction with the carrier in its
    nominal position, negative where they overlap; `lever` (angles, discs, pins) [m] is how much
    of it a forward turn of the disc closes, per radian; `turn` (units, angles, discs) [rad] is how
    far each disc is turned forward by its cranks and its angular error; `play` (units, 1, discs)
    [rad] is its free turn in either sense in the crank bearings.
    """

    gap: Array
    lever: Array
    turn: Array
    play: Array


@dataclass(frozen=True, slots=True, eq=False)
class Displacements:
    """Displacements by part errors; complex numbers are points of the plane [m], or directions.

    `pins` (units, discs, pins) displaces pins in axes of the housing, `across` the same shape [m]
    is the change of the gap by radii. The rest is (units, discs): `turning` displaces the disc's
    centre in axes that turn with its eccentric, `offset` in those of the disc; `around` [rad] turns
    it by its part across the line of the cranks, `angle` [rad] forward; `play` as in `Gaps`;
    `shift` [m]; `pitch` [rad] is the turn F_p/(2 r_p) exp(i phase) of a tooth at angle u, to be
    taken at exp(i u) as a scalar product.
    """

    pins: Complex
    across: Array
    turning: Complex
    offset: Complex
    around: Complex
    angle: Array
    play: Array
    shift: Array
    pitch: Complex

    def centre(self, axes: Axes) -> Complex:
        """Displacement of the profiles' centres in axes of the housing, (units, angles, discs)."""
        return self.turning[:, None] * axes.eccentric + self.offset[:, None] * axes.disc

    def turn(self, axes: Axes) -> Array:
        """Forward turn of the discs [rad], (units, angles, discs)."""
        return np.asarray(self.angle[:, None] - np.imag(self.around[:, None] * axes.crank))


@dataclass(frozen=True, slots=True, eq=False)
class Axes:
    """Directions exp(i angle), each (angles, discs).

    Of the eccentric and of the disc in the housing, and of the eccentric against the line of the
    cranks.
    """

    eccentric: Complex
    disc: Complex
    crank: Complex

    @classmethod
    def at(cls, geometry: ContactGeometry, angles: Array) -> Self:
        """The directions at crank angles [rad], (angles,)."""
        at, carrier = angles[:, None], -angles[:, None] / geometry.nominal.cycloid_teeth
        of_disc = geometry.disc_angles
        return cls(unit(at + of_disc), unit(carrier + of_disc), unit(at + of_disc - carrier))


def displacements(geometry: ContactGeometry, errors: PartErrors) -> Displacements:
    """The displacements of all units."""
    sizes = {"units": errors.units, "discs": geometry.discs, "pins": geometry.pins, "cranks": geometry.cranks}
    full = {name: errors.full(name, sizes) for name in errors.__slots__}
    circle = full["circle_offset"] * unit(full["circle_phase"])
    e, a_0 = geometry.nominal.eccentricity, geometry.nominal.centre_distance
    eccentrics = (e + full["eccentricity"]) * unit(full["crank_phase"]) - e
    cranks = unit(-2.0 * np.pi * np.arange(geometry.cranks) / geometry.cranks)
    position = full["bore_radial"] + 1j * full["bore_tangential"]
    bores = position * cranks.conj()[:, None] * unit(-geometry.disc_angles)
    return Displacements(
        pins=_pins(geometry, full) * unit(geometry.pin_angles) + circle[:, None, None],
        across=full["hole_radius"] - full["pin_radius"] + full["equidistance"][:, :, None],
        turning=eccentrics.mean(axis=1),
        offset=full["disc_offset"] * unit(full["disc_offset_phase"]) - bores.mean(axis=1),
        around=(eccentrics * cranks[:, None]).mean(axis=1) / a_0,
        angle=full["angle"] + full["bore_tangential"].mean(axis=1) / a_0,
        play=0.5 * full["bearing_clearance"].mean(axis=1) / a_0,
        shift=full["shift"],
        pitch=0.5 * full["pitch"] / geometry.nominal.pin_circle_radius * unit(full["pitch_phase"]),
    )


def gaps(
    geometry: ContactGeometry, errors: PartErrors, angles: Array, exact: bool = False, nominal: Nominal | None = None
) -> Gaps:
    """Gaps of all units at the crank angles [rad], (angles,).

    Errors act to third order about the exact nominal profile (`Nominal.displaced`): within 1 nm of
    exact geometry where a pin's displacements add up to 20 um and its phase is 25 degrees or more;
    nearer to the bottom of a tooth space, where no torque is carried, they are coarser. With
    `exact` the nearest point of the profile is computed for every pin instead. `nominal` at these
    angles may be passed where it is already computed.
    """
    displacement, axes = displacements(geometry, errors), Axes.at(geometry, angles)
    phi, shift = geometry.phase(angles), displacement.shift[:, None, :, None]
    pins = _relative(geometry, displacement, axes, phi)
    nominal = Nominal.at(geometry, phi) if nominal is None else nominal
    gap = _exact(geometry, phi, pins, shift) if exact else nominal.displaced(pins, shift)
    turn, play = displacement.turn(axes), displacement.play[:, None]
    return Gaps(gap + displacement.across[:, None], nominal.lever, turn, play)


def teeth(geometry: ContactGeometry, axes: Axes) -> Complex:
    """exp(i u) of the angle u of each pin in its disc, (angles, discs, pins)."""
    return unit(geometry.pin_angles) * axes.disc.conj()[:, :, None]


def _relative(geometry: ContactGeometry, displacement: Displacements, axes: Axes, phi: Array) -> Complex:
    """Displacement of each pin's centre against its tooth, in the pin's axes."""
    relative = displacement.pins[:, None] - displacement.centre(axes)[..., None]
    relative *= unit(-geometry.pin_angles)
    if np.any(displacement.pitch):
        turned = np.real(displacement.pitch.conj()[:, None, :, None] * teeth(geometry, axes))
        relative -= turned * (1j * nominal_pin(geometry, phi))
    return relative


def _pins(geometry: ContactGeometry, full: Mapping[str, Array]) -> Complex:
    """Displacement of the pins, each in the axes of the pin, (units, discs, pins)."""
    radius = geometry.nominal.pin_circle_radius
    placed = radius + full["circle_radius"][:, None, None] + full["radial_position"]
    return placed * unit(full["tangential_position"] / radius) - radius


def _exact(geometry: ContactGeometry, phi: Array, displacement: Complex, shift: Array) -> Array:
    pin = nominal_pin(geometry, phi) + displacement
    at = curve(geometry, phi, foot(geometry, phi, pin, shift), shift)
    normal = -1j * at.first / np.abs(at.first)
    return np.asarray(np.real((pin - at.point) * normal.conj()) + geometry.dr_rp)
