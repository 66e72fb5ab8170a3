"""Gaps between pins and discs with every part error, at any crank angles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import PartErrors
from .geometry import ContactGeometry, curve, foot, lever, nominal_pin, unit
from .nominal import Nominal

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class Gaps:
    """What the parts of units x crank angles leave between pins and discs.

    `gap` (units, angles, discs, pins) [m] is in the normal direction with the carrier in its
    nominal position, negative where they overlap; `lever` (angles, discs, pins) [m] is what a
    forward turn of the disc closes of it, per radian; `turn` (units, angles, discs) [rad] is what
    each disc is turned forward by its cranks and its own angular error; `play` (units, 1, discs)
    [rad] is its free turn either way in the crank bearings.
    """

    gap: Array
    lever: Array
    turn: Array
    play: Array


@dataclass(frozen=True, slots=True, eq=False)
class Displacements:
    """What part errors move, in axes of the housing; complex numbers are points of the plane [m].

    `pins` (units, discs, pins) is the displacement of the pins, `across` the same shape [m] what
    radii add to the gap; `centre` (units, angles, discs) that of the profiles' centres; `turn` and
    `play` as in `Gaps`; `shift` (units, discs) [m]; `pitch` (units, discs) [rad] is the turn
    F_p/(2 r_p) exp(i phase) of a tooth at angle u, to be taken at exp(i u) as a scalar product.
    """

    pins: Complex
    across: Array
    centre: Complex
    turn: Array
    play: Array
    shift: Array
    pitch: Complex


def displacements(geometry: ContactGeometry, errors: PartErrors, angles: Array) -> Displacements:
    """The displacements of all units at the crank angles [rad], (angles,)."""
    sizes = {
        "units": errors.units,
        "discs": geometry.discs,
        "pins": geometry.pins,
        "cranks": geometry.cranks,
    }
    full = {name: errors.full(name, sizes) for name in errors.__slots__}
    circle = full["circle_offset"] * unit(full["circle_phase"])
    radius = 2.0 * geometry.nominal.pin_circle_radius
    play = 0.5 * full["bearing_clearance"].mean(axis=1) / geometry.nominal.centre_distance
    return Displacements(
        pins=_pins(geometry, full) * unit(geometry.pin_angles) + circle[:, None, None],
        across=full["hole_radius"] - full["pin_radius"] + full["equidistance"][:, :, None],
        centre=_centre(geometry, full, angles),
        turn=_turn(geometry, full, angles),
        play=play[:, None],
        shift=full["shift"],
        pitch=full["pitch"] / radius * unit(full["pitch_phase"]),
    )


def gaps(
    geometry: ContactGeometry,
    errors: PartErrors,
    angles: Array,
    exact: bool = False,
    nominal: Nominal | None = None,
) -> Gaps:
    """Gaps of all units at the crank angles [rad], (angles,).

    Errors act to third order about the exact nominal profile (`Nominal.displaced`): within 1 nm
    of exact geometry where a pin's displacements add up to 20 um and its phase is 25 degrees or
    more; nearer to the bottom of a tooth space, where no torque is carried, they are coarser.
    `exact` finds the nearest point of the profile for every pin instead. `nominal` at these angles
    may be given where it is known.
    """
    moved = displacements(geometry, errors, angles)
    phi, shift = geometry.phase(angles), moved.shift[:, None, :, None]
    pins = _relative(geometry, moved, angles)
    if exact:
        found = _exact(geometry, phi, pins, shift)
    else:
        nominal = Nominal.at(geometry, phi) if nominal is None else nominal
        found = nominal.displaced(pins, shift)
    across = moved.across[:, None]
    return Gaps(found + across, lever(geometry, phi), moved.turn, moved.play)


def teeth(geometry: ContactGeometry, angles: Array) -> Complex:
    """exp(i u) of the angle u of each pin in its disc, (angles, discs, pins)."""
    disc = geometry.disc_angles - angles[:, None] / geometry.nominal.cycloid_teeth
    return unit(geometry.pin_angles - disc[:, :, None])


def _relative(geometry: ContactGeometry, moved: Displacements, angles: Array) -> Complex:
    """Displacement of each pin's centre against its tooth, in the pin's axes."""
    relative = moved.pins[:, None] - moved.centre[..., None]
    relative *= unit(-geometry.pin_angles)
    if np.any(moved.pitch):
        turned = np.real(moved.pitch.conj()[:, None, :, None] * teeth(geometry, angles))
        relative -= turned * (1j * nominal_pin(geometry, geometry.phase(angles)))
    return relative


def _eccentrics(geometry: ContactGeometry, full: Mapping[str, Array]) -> Complex:
    """Displacement of the eccentrics against nominal, in axes that turn with them."""
    e = geometry.nominal.eccentricity
    return (e + full["eccentricity"]) * unit(full["crank_phase"]) - e


def _turn(geometry: ContactGeometry, full: Mapping[str, Array], angles: Array) -> Array:
    """Forward turn of the discs: the mean of the eccentrics' tangential displacements over a_0."""
    cranks = 2.0 * np.pi * np.arange(geometry.cranks) / geometry.cranks
    around = np.mean(_eccentrics(geometry, full) * unit(-cranks)[:, None], axis=1)
    relative = angles * (1.0 + 1.0 / geometry.nominal.cycloid_teeth)
    phase = unit(relative[:, None] + geometry.disc_angles)
    turned = np.imag(around[:, None] * phase) / geometry.nominal.centre_distance
    return np.asarray(full["angle"][:, None] - turned)


def _centre(geometry: ContactGeometry, full: Mapping[str, Array], angles: Array) -> Complex:
    """Displacement of the centres of the profiles, (units, angles, discs)."""
    disc = geometry.disc_angles - angles[:, None] / geometry.nominal.cycloid_teeth
    eccentric = unit(angles[:, None] + geometry.disc_angles)
    offset = full["disc_offset"] * unit(full["disc_offset_phase"])
    turning: Complex = _eccentrics(geometry, full).mean(axis=1)
    return turning[:, None] * eccentric + offset[:, None] * unit(disc)


def _pins(geometry: ContactGeometry, full: Mapping[str, Array]) -> Complex:
    """Displacement of the pins in their own axes, (units, discs, pins)."""
    radius = geometry.nominal.pin_circle_radius
    placed = radius + full["circle_radius"][:, None, None] + full["radial_position"]
    return placed * unit(full["tangential_position"] / radius) - radius


def _exact(geometry: ContactGeometry, phi: Array, moved: Complex, shift: Array) -> Array:
    pin = nominal_pin(geometry, phi) + moved
    at = curve(geometry, phi, foot(geometry, phi, pin, shift), shift)
    normal = -1j * at.first / np.abs(at.first)
    return np.asarray(np.real((pin - at.point) * normal.conj()) + geometry.dr_rp)
