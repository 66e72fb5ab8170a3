"""The positions of a turn at which units are measured, and which pins can touch there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import gcd

import numpy as np
from numpy.typing import NDArray

from ....section import Array, Complex, Single
from ....units import ARCMIN, MM, UM
from ..contact.geometry import Axes, ContactGeometry, lever, unit
from ..cycloid import pin_circle_growth
from .units import LEAST_LEVER, BaseSample, Profile, UnitDesign


def turn_lattice(positions: int, teeth: int) -> Array:
    """Crank angles [rad] (positions,) over one output turn, halfway between multiples of a part."""
    return 2.0 * np.pi * teeth * (np.arange(positions) + 0.5) / positions


def shares_a_factor(positions: int, geometry: ContactGeometry) -> bool:
    """Whether the positions share a factor with teeth or pins, so that phases of the mesh recur."""
    nominal = geometry.nominal
    return positions > 1 and (gcd(positions, nominal.cycloid_teeth) > 1 or gcd(positions, nominal.pins) > 1)


def merit(positions: int, geometry: ContactGeometry) -> int:
    """The least h |g| of waves h z_c + g per output turn, h > 0, that are equal at all positions.

    A wave of the crank's order h and the disc's order g looks constant where positions divide
    h z_c + g, so that the turn is sampled along a few lines. 0 where z_c and positions share a
    factor, z_c at most (h = 1). The largest backlash over the turn is as accurate as the
    number of positions allows where this is at least a tenth of them, or z_c.
    """
    teeth = geometry.nominal.cycloid_teeth
    rest = [(h * teeth) % positions for h in range(1, positions)]
    return min((h * min(r, positions - r) for h, r in enumerate(rest, 1)), default=0)


def spreads_evenly(positions: int, geometry: ContactGeometry) -> bool:
    """Whether the positions cover disc and crank evenly; 79, 157 and 313 of 39 teeth do not."""
    least = min(geometry.nominal.cycloid_teeth, 0.1 * positions)
    return not shares_a_factor(positions, geometry) and merit(positions, geometry) >= least


def nearest_prime(positions: int, geometry: ContactGeometry) -> int:
    """The prime nearest to `positions` without a factor of teeth and pins that spreads evenly."""
    for step in range(positions + 50):
        for candidate in (positions + step, positions - step):
            if _is_prime(candidate) and spreads_evenly(candidate, geometry):
                return candidate
    raise ArithmeticError(f"no prime near {positions} positions spreads evenly over the turn")


def _is_prime(number: int) -> bool:
    return number > 1 and all(number % k for k in range(2, int(number**0.5) + 1))


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """Positions of a turn and the contacts that can bear at each, in the order of the kernels.

    A contact is a pin of a disc at a position with a lever arm of `LEAST_LEVER` or more; `start`
    (positions, discs, 2) is the first contact of the forward (0) and backward (1) flank, `stop`
    one past the last. By contact: `pin` its pin, `disc` its disc, `phase` [rad] the magnitude of its phase, `side` the
    sign of it, `direction` exp(i theta) of the pin. `profile` is the nominal profile there. `directions`
    (positions, discs, 6) are cosine and sine of the eccentric, of the
    disc, and of the eccentric against the line of the cranks.
    """

    geometry: ContactGeometry
    angles: Array
    start: NDArray[np.int64]
    stop: NDArray[np.int64]
    pin: NDArray[np.int64]
    disc: NDArray[np.int64]
    phase: Array
    side: Array
    direction: Complex
    profile: Profile
    directions: Single

    @classmethod
    def of(cls, geometry: ContactGeometry, angles: Array) -> Lattice:
        """The lattice of crank angles [rad], (positions,)."""
        phase = np.angle(unit(geometry.phase(angles)))
        arm = lever(geometry, phase) / geometry.nominal.lever
        start, stop, discs, pins, phases = _contacts(arm, phase)
        size = np.abs(phases)
        return cls(
            geometry,
            np.asarray(angles, dtype=float),
            start,
            stop,
            pins,
            discs,
            size,
            np.sign(phases),
            unit(geometry.pin_angles)[pins],
            Profile.of(geometry, size),
            _directions(geometry, angles),
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of positions and of discs."""
        return len(self.angles), self.geometry.discs

    @property
    def tooth(self) -> NDArray[np.int64]:
        """The space between teeth of all discs that the pin of each contact lies in, counted after the pins."""
        geometry, count = self.geometry, self.geometry.nominal.cycloid_teeth
        at = np.repeat(np.arange(len(self.angles)), (self.stop - self.start).sum(axis=(1, 2)))
        # where the pin would be in its disc at phase 0, in the middle of its space
        in_disc = np.angle(Axes.at(geometry, self.angles).disc.conj()[at, self.disc] * self.direction)
        spaces = np.rint((count * in_disc - self.phase * self.side) / (2.0 * np.pi)).astype(np.int64) % count
        return np.asarray(geometry.pins + count * self.disc + spaces)


def _contacts(
    arm: Array, phase: Array
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], Array]:
    """Start and stop (positions, discs, 2) and, by contact, disc, pin and phase."""
    flank = np.stack([arm >= LEAST_LEVER, arm <= -LEAST_LEVER], axis=2)
    count = flank.sum(axis=-1)
    stop = np.cumsum(count).reshape(count.shape)
    _, discs, _, pins = np.nonzero(flank)
    phases = np.broadcast_to(phase[:, :, None, :], flank.shape)[flank]
    return stop - count, stop, discs.astype(np.int64), pins.astype(np.int64), phases


def _directions(geometry: ContactGeometry, angles: Array) -> Single:
    """Cosines and sines (positions, discs, 6) of eccentric, disc, and eccentric against cranks."""
    axes = Axes.at(geometry, angles)
    parts = [part for axis in (axes.eccentric, axes.disc, axes.crank) for part in (axis.real, axis.imag)]
    return np.ascontiguousarray(np.stack(parts, axis=-1), dtype=np.float32)


# Units of one allocation: the base sample scaled to its zones, as the kernels take it.


@dataclass(frozen=True, slots=True, eq=False)
class Scaled:
    """Errors of n units, units last.

    By pin (pins, n) [um]: `across` adds to the gap, `along` displaces the pin counter-clockwise; where teeth
    have errors of their own, rows that displace the pins in the spaces of each disc follow, and `pitch` is 0. By
    disc (discs, n): `normal` [um] adds to the gap, `radial` [um] is the growth of the pin circle
    against the profile, `play` [arcmin] the free turn in either sense, `ahead` [arcmin] the forward
    turn.
    Complex (discs, n): `turning` and `offset` [um] displace the disc's centre in axes of its
    eccentric and of the disc, `around` [arcmin] turns it by its part across the line of cranks,
    `pitch` [arcmin] turns the tooth at angle u by its part along exp(iu). `circle` (n,) [um]
    displaces the pin circle.
    """

    across: Single
    along: Single
    normal: Array
    radial: Array
    play: Array
    ahead: Array
    turning: Complex
    offset: Complex
    around: Complex
    pitch: Complex
    circle: Complex

    @classmethod
    def of(cls, geometry: ContactGeometry, sample: BaseSample, design: UnitDesign) -> Scaled:
        """The units of a design."""
        z, width, mid = sample.z, design.width, design.middle
        arm = UM / geometry.nominal.centre_distance / ARCMIN  # arcmin per um at the cranks
        across = width("pin_hole_radius") * z["pin_hole_radius"]
        across -= width("pin_radius") * z["pin_radius"]
        across += mid("pin_hole_radius") - mid("pin_radius")
        journals = eccentrics(geometry, sample, design)
        tangential = width("bore") * z["bore_tangential"].mean(axis=0)
        growth = mid("pin_circle_radius") + width("pin_circle_radius") * z["pin_circle_radius"]
        along, pitch = width("pin_position") * z["pin_position"], mid("pitch") + width("pitch") * z["pitch"]
        if sample.teeth is not None:
            along = np.concatenate([along, tooth_rows(geometry, sample.teeth, pitch)])
        return cls(
            across=across.astype(np.float32),
            along=along.astype(np.float32),
            normal=mid("equidistance") + width("equidistance") * z["equidistance"],
            radial=growth - mid("shift") - width("shift") * z["shift"],
            play=0.5 * arm * geometry.play_factor * bearing_clearance(sample, design).mean(axis=0),
            ahead=arm * tangential + design.stagger * sides(geometry)[:, None],
            turning=journals.mean(axis=0),
            offset=0.5 * _waves(sample, design, "runout") - bores(geometry, sample, design),
            around=arm * (journals * crank_lines(geometry)).mean(axis=0),
            pitch=_waves(sample, design, "pitch") * pitch_turn(geometry) * (sample.teeth is None),
            circle=width("circle_offset") * z["circle_offset"] * unit(sample.phase["circle_offset"]),
        )

    @property
    def units(self) -> int:
        """Number of units."""
        return int(self.across.shape[1])


def sides(geometry: ContactGeometry) -> Array:
    """Direction in which the stagger turns each disc, (discs,): alternately ahead and back."""
    return np.where(np.arange(geometry.discs) % 2 == 0, 1.0, -1.0)


def crank_lines(geometry: ContactGeometry) -> Complex:
    """exp(-i angle) of the cranks on their circle, (cranks, 1, 1)."""
    turn = -2.0 * np.pi * np.arange(geometry.cranks) / geometry.cranks
    return unit(turn)[:, None, None]


def bore_axes(geometry: ContactGeometry) -> Complex:
    """Direction of each bore in its disc, (cranks, discs, 1)."""
    return np.asarray(crank_lines(geometry).conj() * unit(-geometry.disc_angles)[None, :, None])


def pitch_turn(geometry: ContactGeometry) -> float:
    """Turn [arcmin] of a tooth per um of cumulative pitch error: F_p/(2 r_p)."""
    return 0.5 * UM / geometry.nominal.pin_circle_radius / ARCMIN


def tooth_rows(geometry: ContactGeometry, teeth: Array, pitch: Array) -> Array:
    """Displacements [um] along the pin circle (discs * teeth, n) that turn discs as their teeth do.

    `teeth` (discs, teeth, n) are the errors of teeth per half of the cumulative pitch error `pitch` (discs, n) [um]. A
    contact's normal passes through the pitch point, e z_p from the axis of the pins and e z_c from that of the disc.
    """
    ratio = geometry.nominal.cycloid_teeth / geometry.pins
    return np.asarray((-0.5 * ratio * teeth * pitch[:, None]).reshape(-1, teeth.shape[-1]))


def eccentrics(geometry: ContactGeometry, sample: BaseSample, design: UnitDesign) -> Complex:
    """Displacement d_e + i e eps [um] of each eccentric in its axes, (cranks, discs, n)."""
    ahead = 1e-3 * geometry.nominal.eccentricity / UM  # um per mrad
    radial = design.middle("eccentricity") + design.width("eccentricity") * sample.z["eccentricity"]
    return np.asarray(radial + 1j * ahead * design.width("crank_phase") * sample.z["crank_phase"])


def bores(geometry: ContactGeometry, sample: BaseSample, design: UnitDesign) -> Complex:
    """Mean displacement [um] of the bores in axes of the disc, (discs, n)."""
    position = sample.z["bore_radial"] + 1j * sample.z["bore_tangential"]
    return np.asarray(design.width("bore") * (position * bore_axes(geometry)).mean(axis=0))


def bearing_clearance(sample: BaseSample, design: UnitDesign) -> Array:
    """Radial clearance [um] of each bearing in its zone [0, c], (cranks, discs, n).

    A mid-limit, which no document has, is added to every clearance.
    """
    fraction = 0.5 * (1.0 + sample.z["crank_bearing"])
    return np.asarray(design.middle("crank_bearing") + design.width("crank_bearing") * fraction)


def _waves(sample: BaseSample, design: UnitDesign, error: str) -> Complex:
    """A once-per-turn error [um] of each disc at its phase, (discs, n)."""
    size = design.middle(error) + design.width(error) * sample.z[error]
    return np.asarray(size * unit(sample.phase[error]))


# Units whose parts differ from the drawn ones: changes of errors and temperatures.


def change_units(geometry: ContactGeometry, units: Scaled, sample: BaseSample, changes: Mapping[str, Array]) -> Scaled:
    """Units (n) with their errors [um] and temperatures [K] changed, each by a number or by (n,).

    A change of an error is a change of its mid-limit, the same for every pin and disc of the unit.
    A warmer housing widens the pin circle against the discs; a change of pin position turns the
    unit only.
    """

    def of(error: str) -> Array:
        return np.asarray(changes.get(f"{error}_um", 0.0), dtype=float)

    if not changes:
        return units
    rises = [np.asarray(changes.get(f"{part}_temperature_K", 0.0)) for part in ("disc", "housing")]
    circle = of("pin_circle_radius") + pin_circle_growth(geometry.nominal, *rises) / UM
    across = of("pin_hole_radius") - of("pin_radius")
    pitch, along = of("pitch") * pitch_turn(geometry) * unit(sample.phase["pitch"]), units.along
    if sample.teeth is not None:
        size = np.broadcast_to(of("pitch"), sample.z["pitch"].shape)
        rows, pitch = tooth_rows(geometry, sample.teeth, size), np.zeros_like(pitch)
        along = along + np.pad(rows, ((geometry.pins, 0), (0, 0))).astype(np.float32)
    return replace(
        units,
        along=along,
        across=(units.across + across).astype(np.float32),
        normal=units.normal + of("equidistance"),
        radial=units.radial + circle - of("shift"),
        offset=units.offset + 0.5 * of("runout") * unit(sample.phase["runout"]),
        pitch=units.pitch + pitch,
    )


# Coefficients of every contact of a lattice from the nominal profile, at a modification.


COLUMNS = ("gap", "lever", "radial", "tangential", "x", "y", "cos", "sin", "by_shift")


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Coefficients (contacts, columns) of the turn at which a contact is made.

    `gap` [arcmin] of perfect parts; `lever` kappa [arcmin/um], the turn of the disc that closes a
    gap; kappa times the normal's `radial` and `tangential` part in the pin's axes and its `x` and
    `y` in the housing's; `cos` and `sin` of the pin's angle; `by_shift` [arcmin/mm], the derivative
    of `gap` by the shift modification. `arm` [m] (contacts,) is the signed lever arm and
    `arm_by_shift` [m/mm] its derivative.
    """

    values: Single
    arm: Array
    arm_by_shift: Array

    @classmethod
    def of(cls, lattice: Lattice, dr_rp: float, dr_p: float) -> Table:
        """The table at modifications [m]."""
        (distance, along, across, arm), slope = lattice.profile.at(dr_p)
        across, arm = across * lattice.side, arm * lattice.side
        kappa = UM / ARCMIN / arm
        gap = (distance + dr_rp) / arm / ARCMIN
        longer = slope[3] * lattice.side
        by_shift = slope[0] / arm / ARCMIN - gap * longer / arm
        housing = kappa * (along + 1j * across) * lattice.direction
        columns = [
            gap,
            kappa,
            kappa * along,
            kappa * across,
            housing.real,
            housing.imag,
            lattice.direction.real,
            lattice.direction.imag,
            by_shift * MM,
        ]
        return cls(np.stack(columns, axis=1).astype(np.float32), arm, longer * MM)
