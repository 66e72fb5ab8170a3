"""Faults of pins and discs: teeth, room, undercut and interference with their angles."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ....errors import Fault, raise_all
from ....section import Array
from ....units import ARCMIN, MM, UM
from .geometry import ContactGeometry, Mesh, Nominal, PartErrors, curve, gaps

LEAST_GAP = -1e-9
"""Overlap [m] that still counts as none: the accuracy of nominal gaps."""
_POINTS = 3601


@lru_cache(maxsize=64)
def faults(geometry: ContactGeometry, place: str = "parameters") -> tuple[Fault, ...]:
    """Every fault of the profile, at the keys of a configuration (`dr_p_mm`, `pin_radius_mm`)."""
    return shape_faults(geometry, place) or tuple(interference(geometry, f"{place}.dr_p_mm"))


@lru_cache(maxsize=64)
def shape_faults(geometry: ContactGeometry, place: str = "parameters") -> tuple[Fault, ...]:
    """Faults of the nominal parts, independent of the play of the modification."""
    return (*_teeth(geometry, place), *_pins(geometry, place), *_profile(geometry, place))


def _teeth(geometry: ContactGeometry, place: str) -> Iterator[Fault]:
    expected = geometry.nominal.cycloid_teeth + 1
    if geometry.pins != expected:
        yield Fault(
            f"{place}.pins",
            f"must be {expected}, one more than the {expected - 1} teeth of a disc, got "
            f"{geometry.pins}: the profile advances by one tooth per turn of the cranks",
        )
    if geometry.pins % geometry.discs:
        yield Fault(
            f"{place}.discs", f"must divide the {geometry.pins} pins, got {geometry.discs}: the discs would differ"
        )


def _pins(geometry: ContactGeometry, place: str) -> Iterator[Fault]:
    """Neighbouring pins of the housing need room."""
    nominal = geometry.nominal
    apart = 2.0 * nominal.pin_circle_radius * np.sin(np.pi / nominal.pins)
    if apart <= 2.0 * nominal.pin_radius:
        yield Fault(
            f"{place}.pin_radius_mm",
            f"neighbouring pins overlap: {nominal.pins} pins on a circle of radius "
            f"{nominal.pin_circle_radius / MM:g} mm are {apart / MM:.4g} mm apart, the pins' "
            f"diameter is {2.0 * nominal.pin_radius / MM:.4g} mm; take thinner or fewer pins or a "
            "larger circle",
        )


def _profile(geometry: ContactGeometry, place: str) -> Iterator[Fault]:
    if 0.0 < geometry.nominal.k1 < 1.0:
        yield from _undercut(geometry, place)
    else:
        k1 = f"e z_p/r_p = {geometry.nominal.k1:.4g}"
        yield Fault(f"{place}.eccentricity_mm", f"{k1} must lie between 0 and 1")


def _undercut(geometry: ContactGeometry, place: str) -> Iterator[Fault]:
    """The tooth is cut away where C is bent outwards with a radius below that of the offset."""
    phi = np.linspace(0.0, np.pi, _POINTS)
    c = curve(geometry, phi, np.zeros_like(phi))
    bend = np.imag(c.first.conj() * c.second) / np.abs(c.first) ** 3
    offset = geometry.nominal.pin_radius + geometry.dr_rp
    worst = int(np.argmax(bend))
    if bend[worst] * offset >= 1.0:
        yield Fault(
            f"{place}.pin_radius_mm",
            f"the profile is undercut at a profile angle of {np.degrees(phi[worst]):.1f} deg: "
            f"its radius of curvature there, {1.0 / bend[worst] / MM:.3g} mm, is below the pin's "
            f"with the equidistance modification, {offset / MM:.3g} mm; take thinner pins or a "
            "smaller eccentricity",
        )


def interference(geometry: ContactGeometry, place: str) -> Iterator[Fault]:
    """A modified profile that leaves no play.

    Symmetric in phi: where a gap is negative, no rotation opens it on both flanks.
    """
    phi = np.linspace(0.0, np.pi, _POINTS)
    gap = Nominal.at(geometry, phi).gap
    worst = int(np.argmin(gap))
    if gap[worst] < LEAST_GAP:
        yield Fault(
            place,
            f"the modified profile interferes with the pins by {-gap[worst] / UM:.3g} um at a "
            f"profile angle of {np.degrees(phi[worst]):.1f} deg (dr_rp {geometry.dr_rp / MM:g} mm, "
            f"dr_p {geometry.dr_p / MM:g} mm); raise dr_rp_mm or lower dr_p_mm",
        )


# The loaded contact of pins and discs: balance of torque under part errors.


BLOCK = 512
"""Meshes (a unit at a crank angle) solved at once by arrays, so that they stay in the cache."""


class OverloadWarning(UserWarning):
    """A torque beyond the momentary torque of the reducer."""


@dataclass(frozen=True, slots=True, eq=False)
class Equilibrium:
    """Balance of units x crank angles under a torque on the carrier.

    `rotation` (units, angles) [rad] is that of the carrier, forward from nominal; `pin_forces`
    (units, angles, discs, pins) [N] are normal; `loaded` (units, angles, discs) counts the pins
    that bear; `residual` (units, angles) [N m] is the pins' torque minus the applied torque.
    """

    rotation: Array
    pin_forces: Array
    loaded: NDArray[np.int64]
    residual: Array


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """The meshes of some units at some angles, and their place among all (units, angles)."""

    place: tuple[slice, slice]
    mesh: Mesh


@dataclass(frozen=True, slots=True, eq=False)
class LoadedContact:
    """Pins and discs of one design, with its stiffness.

    `normal_stiffness` [N/m] of a pin contact along its normal and `series_stiffness` [N m/rad]
    between one disc and the carrier (bearings, cranks, carrier; `inf` without) are assumptions;
    both may be arrays that fit (units, angles, discs), so that discs share unequally or stiffness
    depends on the angle. Torques [N m] of the catalogue. `exact`: see `gaps`. Raises InputError
    where the profile interferes or is undercut (`faults`).
    """

    geometry: ContactGeometry = ContactGeometry()
    normal_stiffness: Array | float = 2e8
    series_stiffness: Array | float = 58.5 / ARCMIN
    rated_torque: float = 412.0
    momentary_torque: float = 2058.0
    exact: bool = False

    def __post_init__(self) -> None:
        raise_all(faults(self.geometry))
        for name in ("normal_stiffness", "series_stiffness"):
            if not np.all(np.asarray(getattr(self, name)) > 0.0):
                raise ValueError(f"{name} must be above 0")

    def mesh(self, errors: PartErrors, angles: Array, nominal: Nominal | None = None) -> Mesh:
        """The meshes of all units at the crank angles (angles,) [rad], gaps computed once."""
        gaps_of_units = gaps(self.geometry, errors, angles, self.exact, nominal)
        normal, series = self._stiffness()
        return Mesh.of(gaps_of_units, self.geometry.output_ratio, normal[..., None], 1.0 / series)

    def equilibrium(self, errors: PartErrors, angles: Array, torque: Array | float, direction: int = 1) -> Equilibrium:
        """Balance under a torque on the carrier, forward positive, that fits (units, angles).

        Without torque the carrier is at first contact in `direction` (+1, -1). Warns
        (`OverloadWarning`) of a torque beyond the momentary one, and computes it.
        """
        warn_of_overload(torque, self.momentary_torque)
        mesh = self.mesh(errors, angles)
        rotation = mesh.rotation(torque, direction)
        forces = mesh.pin_forces(rotation)
        mesh_torque = np.einsum("uadp,adp->ua", forces, mesh.gaps.lever) * mesh.ratio
        return Equilibrium(rotation, forces, np.sum(forces > 0.0, axis=-1), mesh_torque - torque)

    def rotation(self, errors: PartErrors, angles: Array, torque: Array | float, direction: int = 1) -> Array:
        """The rotation of `equilibrium` alone, compiled unless the contact is `exact`; its memory
        does not grow with the contacts.
        """
        warn_of_overload(torque, self.momentary_torque)
        torques = np.broadcast_to(torque, (errors.units, angles.size))
        if not self.exact:
            from . import kernel

            return kernel.rotation(self.geometry, errors, angles, *self._stiffness(), torques, direction)
        rotations = np.empty(torques.shape)
        for block in self.blocks(errors, angles):
            rotations[block.place] = block.mesh.rotation(torques[block.place], direction)
        return rotations

    def blocks(self, errors: PartErrors, angles: Array) -> Iterator[Block]:
        """The meshes in blocks of some units at some angles."""
        wide = min(angles.size, BLOCK)
        tall = max(1, BLOCK // wide)
        for start in range(0, angles.size, wide):
            part = slice(start, start + wide)
            nominal = Nominal.at(self.geometry, self.geometry.phase(angles[part]))
            for first in range(0, errors.units, tall):
                units = slice(first, first + tall)
                contact = self._of(units, part)
                yield Block((units, part), contact.mesh(errors.of_units(units), angles[part], nominal))

    def _stiffness(self) -> tuple[Array, Array]:
        """Normal and series stiffness with the axes (units, angles, discs)."""
        return _three_axes(self.normal_stiffness), _three_axes(self.series_stiffness)

    def _of(self, units: slice, angles: slice) -> LoadedContact:
        """The contact with the stiffness of some units and angles."""
        normal, series = (
            stiffness[units if len(stiffness) > 1 else slice(None), angles if stiffness.shape[1] > 1 else slice(None)]
            for stiffness in self._stiffness()
        )
        return replace(self, normal_stiffness=normal, series_stiffness=series)


def _three_axes(value: Array | float) -> Array:
    return np.asarray(value, dtype=np.float64).reshape((1,) * (3 - np.ndim(value)) + np.shape(value))


def warn_of_overload(torque: Array | float, momentary: float) -> None:
    """Warn (`OverloadWarning`) of torques [N m] beyond the momentary one; they are computed."""
    most = float(np.max(np.abs(torque), initial=0.0))
    if most > momentary:
        text = f"torque {most:g} N m is beyond the momentary torque {momentary:g} N m"
        warnings.warn(text, OverloadWarning, stacklevel=3)


def turn_angles(count: int, teeth: int = 39) -> Array:
    """Crank angles [rad] evenly over one turn of the output, (count,)."""
    return 2.0 * np.pi * teeth * np.arange(count) / count


# Measured quantities of a reducer from its loaded contact: quasi-static, without hysteresis.
#
# All angles are those of the carrier with the sun held, in radians, forward positive.


LOST_MOTION_SHARE = 0.03
"""Fraction of the rated torque, in either sense, at which the catalogue states lost motion."""


def backlash(contact: LoadedContact, errors: PartErrors, angles: Array) -> Array:
    """Backlash of rigid parts at every crank angle, (units, angles); negative: interference."""
    play = np.empty((errors.units, angles.size))
    for block in contact.blocks(errors, angles):
        backward, forward = block.mesh.touch()
        play[block.place] = forward - backward
    return play


def transmission_error(contact: LoadedContact, errors: PartErrors, angles: Array, torque: Array | float) -> Array:
    """theta_in/i - theta_out under a torque on the carrier [N m], (units, angles).

    Its mean over a turn holds the wind-up; without torque it is that of first contact forward, or
    of the balance of preloaded flanks.
    """
    return -contact.rotation(errors, angles, torque)


def torque_twist(contact: LoadedContact, errors: PartErrors, angles: Array, torques: Array) -> Array:
    """Mean rotation over the crank angles at each torque [N m], (units, torques)."""
    twist = np.zeros((errors.units, torques.size))
    for block in contact.blocks(errors, angles):
        for at, torque in enumerate(torques):
            turned = block.mesh.rotation(torque).sum(axis=1)
            twist[block.place[0], at] += turned / angles.size
    return twist


def lost_motion(contact: LoadedContact, errors: PartErrors, angles: Array) -> Array:
    """Difference of mean rotation between +3 % and -3 % of rated torque, (units,)."""
    torque = LOST_MOTION_SHARE * contact.rated_torque
    twist = torque_twist(contact, errors, angles, np.array([-torque, torque]))
    return twist[:, 1] - twist[:, 0]


@dataclass(frozen=True, slots=True, eq=False)
class Loading:
    """Over the crank angles given, per unit: largest and mean peak pin force [N], mean number of
    loaded pins per disc, mean tangent stiffness [N m/rad] at the carrier.
    """

    peak: Array
    mean_peak: Array
    loaded: Array
    stiffness: Array


def loading(contact: LoadedContact, errors: PartErrors, angles: Array, torque: float) -> Loading:
    """The load of the pins under a torque on the carrier [N m]."""
    peak, count, stiffness = (np.empty((errors.units, angles.size)) for _ in range(3))
    for block in contact.blocks(errors, angles):
        rotation = block.mesh.rotation(torque)
        forces = block.mesh.pin_forces(rotation)
        peak[block.place] = forces.max(axis=(2, 3))
        count[block.place] = np.mean(np.sum(forces > 0.0, axis=-1), axis=-1)
        stiffness[block.place] = block.mesh.torque(rotation)[1]
    means = (values.mean(axis=1) for values in (peak, count, stiffness))
    return Loading(peak.max(axis=1), *means)
