"""Gaps between pins and discs with every part error, at any crank angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import PartErrors
from .geometry import ContactGeometry, curve, foot, lever, nominal_pin
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


def gaps(geometry: ContactGeometry, errors: PartErrors, angles: Array, exact: bool = False) -> Gaps:
    """Gaps of all units at the crank angles [rad], (angles,).

    Errors act to third order about the exact nominal profile (`Nominal.displaced`): within 1 nm
    of exact geometry where a pin's displacements add up to 20 um and its phase is 25 degrees or
    more; nearer to the bottom of a tooth space, where no torque is carried, within 1 um. `exact`
    finds the nearest point of the profile for every pin instead.
    """
    sizes = {
        "units": errors.units,
        "discs": geometry.discs,
        "pins": geometry.pins,
        "cranks": geometry.cranks,
    }
    full = {name: errors.full(name, sizes) for name in errors.__slots__}
    moved = _displacement(geometry, full, angles)
    phi = geometry.phase(angles)
    shift = full["shift"][:, None, :, None]
    if exact:
        found = _exact(geometry, phi, moved, shift)
    else:
        found = Nominal.at(geometry, phi).displaced(moved, shift)
    across = full["hole_radius"] - full["pin_radius"] + full["equidistance"][:, :, None]
    return Gaps(
        gap=found + across[:, None],
        lever=lever(geometry, phi),
        turn=_turn(geometry, full, angles),
        play=0.5
        * full["bearing_clearance"].mean(axis=1)[:, None]
        / geometry.nominal.centre_distance,
    )


def _eccentrics(geometry: ContactGeometry, full: dict[str, Array]) -> Complex:
    """Displacement of the eccentrics against nominal, in axes that turn with them."""
    e = geometry.nominal.eccentricity
    return np.asarray((e + full["eccentricity"]) * np.exp(1j * full["crank_phase"]) - e)


def _turn(geometry: ContactGeometry, full: dict[str, Array], angles: Array) -> Array:
    """Forward turn of the discs: the mean of the eccentrics' tangential displacements over a_0."""
    cranks = 2.0 * np.pi * np.arange(geometry.cranks) / geometry.cranks
    around = np.mean(_eccentrics(geometry, full) * np.exp(-1j * cranks)[:, None], axis=1)
    relative = angles * (1.0 + 1.0 / geometry.nominal.cycloid_teeth)
    phase = np.exp(1j * (relative[:, None] + geometry.disc_angles))
    turned = np.imag(around[:, None] * phase) / geometry.nominal.centre_distance
    return np.asarray(full["angle"][:, None] - turned)


def _displacement(geometry: ContactGeometry, full: dict[str, Array], angles: Array) -> Complex:
    """Displacement of each pin's centre against its tooth, in the pin's axes."""
    nominal, away = geometry.nominal, np.exp(-1j * geometry.pin_angles)
    disc = geometry.disc_angles - angles[:, None] / nominal.cycloid_teeth  # (angles, discs)
    eccentric = np.exp(1j * (angles[:, None] + geometry.disc_angles))
    offset = full["disc_offset"] * np.exp(1j * full["disc_offset_phase"])
    centre = _eccentrics(geometry, full).mean(axis=1)[:, None] * eccentric
    centre = centre + offset[:, None] * np.exp(1j * disc)
    circle = full["circle_offset"] * np.exp(1j * full["circle_phase"])
    moved = (circle[:, None, None] - centre)[..., None] * away + _pins(geometry, full)
    if np.any(full["pitch"]):
        teeth = (geometry.pin_angles - disc[..., None]) - full["pitch_phase"][:, None, :, None]
        turned = 0.5 * full["pitch"][:, None, :, None] * np.cos(teeth) / nominal.pin_circle_radius
        moved += nominal_pin(geometry, geometry.phase(angles)) * (np.exp(-1j * turned) - 1.0)
    return np.asarray(moved)


def _pins(geometry: ContactGeometry, full: dict[str, Array]) -> Complex:
    """Displacement of the pins in the housing, (units, 1, discs, pins)."""
    radius = geometry.nominal.pin_circle_radius
    placed = radius + full["circle_radius"][:, None, None] + full["radial_position"]
    return np.asarray(placed * np.exp(1j * full["tangential_position"] / radius) - radius)[:, None]


def _exact(geometry: ContactGeometry, phi: Array, moved: Complex, shift: Array) -> Array:
    pin = nominal_pin(geometry, phi) + moved
    at = curve(geometry, phi, foot(geometry, phi, pin, shift), shift)
    normal = -1j * at.first / np.abs(at.first)
    return np.asarray(np.real((pin - at.point) * normal.conj()) + geometry.dr_rp)
