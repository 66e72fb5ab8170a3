"""First contact of rigid units at every position of a turn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ....section import Array, Complex, Integers, Single
from ..contact.geometry import ContactGeometry
from .errors import COLUMNS, Lattice, Scaled, Table, sides, turn_lattice
from .units import CARRIER_ERRORS, CRANK_HOLE, ERRORS, BaseSample, Coupling, Hierarchy, UnitDesign

if TYPE_CHECKING:
    from .cranks import Jam, Seats

Contacts = NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class Touch:
    """Where units touch: turns of the disc against the mesh [arcmin], (positions, units).

    `high` is first contact forward, `low` backward; `ahead` and `behind` are the contacts of the
    lattice that make it.
    """

    high: Single
    low: Single
    ahead: Contacts
    behind: Contacts

    def cycloid(self, output_ratio: float) -> Single:
        """Backlash y of the cycloid stage at the carrier [arcmin]; below zero: interference."""
        return np.asarray((self.high - self.low) * np.float32(1.0 / output_ratio))


NO_SEATS = np.empty((0, 1, 2, 3, 1), np.float32)


def touch(
    lattice: Lattice,
    table: Table,
    units: Scaled | tuple[Single, ...],
    seats: Single = NO_SEATS,
    discs: slice = slice(None),
) -> Touch:
    """First contact of all units, packed or not, at all positions; `seats` are the places of their `cranks.Seats`,
    `discs` those that touch.
    """
    from . import kernel

    errors = pack_errors(units) if isinstance(units, Scaled) else units
    shape = (lattice.shape[0], errors[0].shape[1])
    contact = Touch(
        np.empty(shape, np.float32), np.empty(shape, np.float32), np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    )
    *contacts, start, stop, axes = contacts_of(lattice, table, errors[1])
    spans = (np.ascontiguousarray(of_discs[:, discs]) for of_discs in (start, stop, axes))
    kernel.touch(
        (*contacts, *spans),
        (*errors[:2], np.ascontiguousarray(errors[2][discs]), errors[3]),
        seats,
        (contact.high, contact.low, contact.ahead, contact.behind),
    )
    return contact


def contacts_of(lattice: Lattice, table: Table, along: Single, rows: Integers | slice = slice(None)) -> tuple[Any, ...]:
    """The contacts at some positions, as the kernels take them, for units of the packed errors `along`."""
    return (
        table.values,
        lattice.pin,
        teeth_of(lattice, along),
        lattice.start[rows],
        lattice.stop[rows],
        lattice.directions[rows],
    )


def teeth_of(lattice: Lattice, along: Single) -> Integers:
    """Rows (contacts,) of the teeth in errors `along` the pin circle, none where teeth have no errors of their own."""
    return lattice.tooth if along.shape[-2] > lattice.geometry.pins else np.empty(0, np.int64)


def pack_errors(units: Scaled) -> tuple[Single, ...]:
    """Errors across and along pins (pins, n), of discs (discs, 12, n) and of the circle (2, n)."""
    columns = [units.normal, units.radial, units.play, units.ahead]
    for errors in (units.turning, units.offset, units.around, units.pitch):
        columns += [errors.real, errors.imag]
    wide = np.broadcast_shapes(*(column.shape for column in columns))
    discs = np.stack([np.broadcast_to(column, wide) for column in columns], axis=1)
    circle = np.stack([units.circle.real, units.circle.imag])
    arrays = (units.across, units.along, discs, circle)
    return tuple(np.ascontiguousarray(values, dtype=np.float32) for values in arrays)


# Derivatives of the backlash of rigid units, by the contacts that touch.
#
# The turns at first contact are the least of functions that are linear in the tolerances, so that
# their derivatives are those of the contacts that make them.


NAMES = (*ERRORS, "stagger", "dr_rp", "dr_p", CRANK_HOLE, "involute")
"""Variables of a gradient: zones [arcmin/um], of crank_phase [arcmin/mrad], stagger, both
modifications [arcmin/mm], the zone of the carrier's holes, and ln(phi_1) through the cranks alone."""


PLAY = 9
"""Row of the discs' standardised errors that has the play of their bearings, and its place in `NAMES`."""
CENTRED = frozenset(("pin_position", "circle_offset", "bore", "crank_phase", CRANK_HOLE))
"""Errors of which a mid-limit would turn or displace the unit, and is left out."""


@dataclass(frozen=True, eq=False)
class Slopes:
    """Standardised errors of a base sample, as `pull_back` takes them; they hold for any design.

    `of_pins` (3, pins, n) has rows of teeth after those of the `pins`, where these have errors of their own.
    `of_cranks` are those of `cranks.standardised`, None where discs are not coupled to their cranks.
    """

    pins: int
    of_unit: Single
    of_discs: Single
    of_pins: Single
    of_cranks: Single | None = None

    @cached_property
    def by_unit(self) -> tuple[Single, Single]:
        """`of_discs` and `of_pins` with all errors of a unit side by side in memory: slopes weigh a part of the units,
        and would wait for memory else.
        """
        return _by_unit(self.of_discs, (2, 0, 1)), _by_unit(self.of_pins, (2, 1, 0))

    @classmethod
    def of(cls, geometry: ContactGeometry, sample: BaseSample) -> Slopes:
        """The slopes of a base sample: what a zone of 1 of each error alone makes of its units."""

        def made(error: str) -> Scaled:
            """The units of a zone of 1 of one error; they are let go of one by one."""
            return Scaled.of(geometry, sample, UnitDesign({error: 1.0}))

        discs = sample.z["shift"].shape
        by_disc: list[Array | Complex] = [
            made("equidistance").normal,
            -made("shift").radial,
            made("pitch").pitch,
            made("runout").offset,
            made("eccentricity").turning.real,
            made("eccentricity").around,
            made("crank_bearing").play,
            -made("bore").offset,
            made("bore").ahead,
            made("crank_phase").turning.imag,
            made("crank_phase").around,
            np.broadcast_to(sides(geometry)[:, None], discs),
        ]
        columns = [part for errors in by_disc for part in _real_parts(errors)]
        circle = made("circle_offset").circle
        radial = made("pin_circle_radius").radial[0]
        of_pins = [made("pin_position").along, made("pin_hole_radius").across, -made("pin_radius").across]
        if sample.teeth is not None:
            of_pins[0] = of_pins[0] + made("pitch").along
            of_pins[1:] = (np.pad(hole, ((0, len(of_pins[0]) - len(hole)), (0, 0))) for hole in of_pins[1:])
        return cls(
            geometry.pins,
            _single_precision(np.stack([radial, circle.real, circle.imag])),
            _single_precision(np.stack(columns, axis=1)),
            _single_precision(np.stack(of_pins)),
            _of_cranks(geometry, sample) if CARRIER_ERRORS[0] in sample.z else None,
        )

    def errors(self, width: Callable[[str], float]) -> tuple[Single, ...]:
        """The errors of units, as `pack_errors` packs them, that zones make: `width` by name of the error."""
        unit, discs, pins = self.of_unit, self.of_discs, self.of_pins
        size = {error: np.float32(width(error)) for error in ERRORS}
        packed = np.empty((len(discs), 12, unit.shape[1]), np.float32)
        packed[:, 0] = size["equidistance"] * discs[:, 0]
        packed[:, 1] = size["pin_circle_radius"] * unit[0] - size["shift"] * discs[:, 1]
        packed[:, 2] = size["crank_bearing"] * discs[:, 9]
        packed[:, 3] = size["bore"] * discs[:, 12]
        packed[:, 4] = size["eccentricity"] * discs[:, 6]
        packed[:, 5] = size["crank_phase"] * discs[:, 13]
        packed[:, 6:8] = size["runout"] * discs[:, 4:6] - size["bore"] * discs[:, 10:12]
        packed[:, 8:10] = size["eccentricity"] * discs[:, 7:9] + size["crank_phase"] * discs[:, 14:16]
        packed[:, 10:12] = size["pitch"] * discs[:, 2:4]
        count = self.pins
        across = size["pin_hole_radius"] * pins[1, :count]
        across -= size["pin_radius"] * pins[2, :count]
        along = size["pin_position"] * pins[0]
        along[count:] = size["pitch"] * pins[0, count:]
        return across, along, packed, size["circle_offset"] * unit[1:]


def _of_cranks(geometry: ContactGeometry, sample: BaseSample) -> Single:
    from . import cranks

    return cranks.standardised(geometry, sample)


def _real_parts(value: Array | Complex) -> tuple[Array, ...]:
    whole = np.asarray(value, dtype=np.complex128)
    return (whole.real, whole.imag) if np.iscomplexobj(value) else (whole.real,)


def _by_unit(values: Single, order: tuple[int, ...]) -> Single:
    """A copy of values with the same axes, which lie in memory in this `order`."""
    return np.ascontiguousarray(values.transpose(order)).transpose(np.argsort(order))


def _single_precision(value: Array | Single) -> Single:
    return np.ascontiguousarray(value, dtype=np.float32)


def pull_back(
    lattice: Lattice, table: Table, touch: Touch, slopes: Slopes, weight: Array, backward: Array | None = None
) -> Array:
    """Derivatives (names,) of sum(weight y) by `NAMES`, for weights (positions, units).

    y is the backlash of the cycloid stage at the carrier [arcmin], interference below zero; `backward` are the weights
    of the backward flanks where they differ.
    """
    from . import kernel

    weights = (weight, weight if backward is None else backward)
    weighted = np.flatnonzero(np.any((weights[0] != 0.0) | (weights[1] != 0.0), axis=1))
    rows: Integers | slice = slice(None) if len(weighted) == len(weight) else weighted
    total = np.zeros(len(NAMES))
    kernel.touch_slopes(
        tuple(_single_precision(of_flank[rows]) for of_flank in weights),
        (touch.ahead[rows], touch.behind[rows]),
        (table.values, lattice.pin, teeth_of(lattice, slopes.of_pins), lattice.disc, lattice.directions[rows]),
        (slopes.of_unit, *slopes.by_unit),
        total,
    )
    total /= lattice.geometry.output_ratio
    total[NAMES.index("dr_rp")] *= 1e3  # from micrometres to millimetres
    return total


# Planets that are coupled through their cranks.


@dataclass(frozen=True, slots=True, eq=False)
class Meeting:
    """Discs of n units on two cranks that turn apart, each as far as the play of its planet allows, bearings rigid.

    `touches` are the first contacts of each disc, with its play. `play` (positions, n) [arcmin] is the backlash at the
    carrier less that of the tighter planet; `by_gap` and `by_play` (2, discs, positions, n) are the derivatives of its
    two flanks by the first contact of each disc and by its play there, `by_size` (positions, n) by ln(planets).
    """

    touches: tuple[Touch, ...]
    play: Single
    by_gap: Single
    by_play: Single
    by_size: Single

    @classmethod
    def of(cls, lattice: Lattice, touches: tuple[Touch, ...], play: Single, planets: Array) -> Meeting:
        """Units whose discs have the `play` (discs, n), and whose planets that of `planets` (2, n) [arcmin] at the
        carrier.
        """
        from . import kernel

        geometry = lattice.geometry
        gear = geometry.nominal.centre_distance / geometry.nominal.lever
        own = 0.25 * geometry.output_ratio / gear * np.stack([planets.sum(axis=0), planets[0] - planets[1]])
        flanks = np.stack([[touch.high for touch in touches], [-touch.low for touch in touches]])
        met, size = np.empty(flanks.shape[2:], np.float32), np.empty(flanks.shape[2:], np.float32)
        by_gap, by_play = np.empty_like(flanks), np.empty_like(flanks)
        into = (met, by_gap, by_play, size)
        kernel.meet(lattice.directions, flanks, play, own, (geometry.play_factor, gear), into)
        unit = np.float32(1.0 / geometry.output_ratio)
        return cls(touches, unit * met, by_gap, by_play, unit * size)

    def slopes(self, lattice: Lattice, table: Table, standardised: Slopes, weight: Array) -> Array:
        """Derivatives (names,) of sum(weight play) by `NAMES`, for weights (positions, n)."""
        total = np.zeros(len(NAMES))
        for d, of_disc in enumerate(self.touches):
            total += pull_back(lattice, table, of_disc, standardised, *(weight * self.by_gap[:, d]))
            more = weight * (self.by_play[:, d] - self.by_gap[:, d]).sum(axis=0) / lattice.geometry.output_ratio
            total[PLAY] += float((more * standardised.of_discs[d, PLAY]).sum())
        total[NAMES.index("involute")] += float((weight * self.by_size).sum())
        return total


# Pins that are sorted into classes and fitted to the measured clearance of a unit.


@dataclass(frozen=True, slots=True)
class PinClasses:
    """Classes of pins: how many, the `width` of their radii [um], and the standard deviation `error` [um] with which
    the radius that a unit needs is known.
    """

    classes: int
    width: float
    error: float


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """Pins fitted to n units: their class (n,) from 0 on, and how much larger than the middle class they are [um] (n,).

    The backlash of a unit grows by `growth` (n,) [arcmin] with z (n,), uniform from -1 to 1: the place of
    its need within a class. `follows` (n,) says whether a change of its clearance changes the pins: not in
    the outermost classes.
    """

    number: Integers
    larger: Array
    z: Array
    growth: Array
    follows: NDArray[np.bool_]


def fit_pins(turn: Turn, sorting: PinClasses, rng: np.random.Generator, counted: bool) -> Fitted:
    """The pins that bring each unit of a turn, measured with pins of the middle class, nearest to the mean of all.

    The backlash of a unit in the mean of the turn falls in proportion to the radius of its pins. Of the classes a unit
    takes that nearest to its need where units are `counted`. In a search, whose values are to be smooth, its need lies
    anywhere within a class, which for needs that spread over several classes has the same law.
    """
    mean, units = turn.play.mean(axis=0, dtype=np.float64), turn.play.shape[1]
    even = np.full(turn.play.shape, 1.0 / turn.play.size)
    by_radius = -float(turn.slopes(even, turn.population.alike)[NAMES.index("pin_radius")])  # arcmin per um
    need = (mean - mean.mean()) / by_radius + sorting.error * rng.standard_normal(units)
    middle = 0.5 * (sorting.classes - 1)
    place = np.clip(np.rint(need / sorting.width + middle), 0, sorting.classes - 1).astype(np.int64)
    larger: Array = (place - middle) * sorting.width
    z = np.zeros(units)
    outermost = 0.5 * (sorting.classes - 1) * sorting.width
    follows = np.abs(need) <= outermost
    if not counted:
        z = np.asarray(rng.uniform(-1.0, 1.0, units))
        larger = np.clip(need - 0.5 * sorting.width * z, -outermost, outermost)
        follows = np.abs(larger) < outermost
    growth = np.full(units, 0.0 if counted else 0.5 * sorting.width * by_radius)
    return Fitted(place, larger, z, np.where(follows, growth, 0.0), follows)


# A turn of rigid units of one design: the backlash of the cycloid stage at every position.


@dataclass(frozen=True, eq=False)
class Population:
    """Positions of a turn, a base sample and its slopes, which all designs have in common."""

    lattice: Lattice
    sample: BaseSample
    slopes: Slopes
    coupling: Coupling | None = None

    @classmethod
    def draw(
        cls,
        geometry: ContactGeometry,
        positions: int,
        units: int,
        rng: np.random.Generator,
        hierarchy: Hierarchy | None = None,
        coupling: Coupling | None = None,
    ) -> Population:
        """A population of `units` at `positions` of a turn of the output."""
        lattice = Lattice.of(geometry, turn_lattice(positions, geometry.nominal.cycloid_teeth))
        sample = BaseSample.draw(geometry, units, rng, hierarchy, holes=coupling is not None)
        return cls(lattice, sample, Slopes.of(geometry, sample), coupling)

    @property
    def units(self) -> int:
        """Number of units."""
        return self.sample.units

    @cached_property
    def _of_mids(self) -> dict[tuple[float, ...], tuple[Single, ...]]:
        """The errors that the mid-limits make in the last design, by these: those of most designs are the same."""
        return {}

    @cached_property
    def alike(self) -> Slopes:
        """Slopes by errors that are the same in all units: every standardised error is 1."""
        return self._slopes_alike()

    def _slopes_alike(self) -> Slopes:
        sample = self.sample
        ones = {name: np.ones_like(z) for name, z in sample.z.items()}
        return Slopes.of(self.lattice.geometry, replace(sample, z=ones))

    def turn(self, design: UnitDesign, pins: Array | None = None, planets: Array | None = None) -> Turn:
        """Units built to a design, over the turn; the pins of a unit may all be larger by `pins` (n,) [um]. Planets
        with a play of `planets` (2, n) [arcmin] at the carrier are coupled through their cranks.
        """
        geometry = self.lattice.geometry
        table = Table.of(self.lattice, design.dr_rp, design.dr_p)
        errors = self.slopes.errors(design.width)
        mid = tuple(0.0 if error in CENTRED else design.middle(error) for error in ERRORS)
        if any(mid):
            if mid not in self._of_mids:
                by_error: dict[str, float] = dict(zip(ERRORS, mid, strict=True))
                alike = self.alike if self._of_mids else self._slopes_alike()  # most populations need it once
                self._of_mids.clear()
                self._of_mids[mid] = alike.errors(by_error.__getitem__)
            errors = tuple(map(np.add, errors, self._of_mids[mid]))
        if pins is not None:
            errors = (errors[0] - pins.astype(np.float32), *errors[1:])
        errors[2][:, 3] += np.float32(design.stagger) * sides(geometry)[:, None].astype(np.float32)
        seats = self._seats(design)
        contact = touch(self.lattice, table, errors, NO_SEATS if seats is None else seats.places)
        tied = Turn(self, design, table, contact, contact.cycloid(geometry.output_ratio), seats=seats)
        if planets is None:
            return tied
        touches = tuple(touch(self.lattice, table, errors, discs=slice(d, d + 1)) for d in range(geometry.discs))
        meeting = Meeting.of(self.lattice, touches, np.ascontiguousarray(errors[2][:, 2]), planets)
        return replace(tied, play=meeting.play, meeting=meeting, held=tied)

    def _seats(self, design: UnitDesign) -> Seats | None:
        """Where units rest on their cranks, None where discs are not coupled to these."""
        if self.coupling is None or self.slopes.of_cranks is None:
            return None
        from . import cranks

        errors = cranks.scaled(self.slopes.of_cranks, design.half_width)
        mids = {error: size for error, size in design.mid.items() if error not in CENTRED}
        if any(mids.values()) and (alike := self.alike.of_cranks) is not None:
            errors += cranks.scaled(alike, mids)
        return cranks.Seats.of(self.lattice, self.coupling, errors)


@dataclass(frozen=True, eq=False)
class Turn:
    """Units of one design over a turn.

    `play` (positions, units) [arcmin] is the backlash y of the cycloid stage at the carrier, play
    of the crank bearings included; below zero the unit interferes there. Where planets are coupled it is the
    backlash of both stages less that of the tighter planet, and `held` says where the unit interferes.
    """

    population: Population
    design: UnitDesign
    table: Table
    touch: Touch
    play: Single
    fitted: Fitted | None = None
    """The pins that are fitted to each unit, None where they are taken as they come."""
    seats: Seats | None = None
    """Where units rest on their cranks, None where discs are not coupled to these."""
    meeting: Meeting | None = None
    """Where units touch whose planets are coupled, None where the tighter one holds all cranks."""
    held: Turn | None = None
    """The same units with cranks that the tighter planet holds, where planets are coupled."""

    @cached_property
    def jam(self) -> Jam:
        """The largest force on a crank bearing without load; of units with seats alone."""
        from .cranks import Jam

        assert self.seats is not None
        return Jam.of(self.seats)

    @cached_property
    def by_circle(self) -> Single:
        """Derivative of `play` by the pin-circle radius [arcmin/um], (positions, units): that of
        the contacts that touch.
        """
        from . import kernel

        radial = self.table.values[:, COLUMNS.index("radial")] / self.population.lattice.geometry.output_ratio
        slope = np.empty_like(self.play)
        kernel.differences(radial, self.touch.ahead, self.touch.behind, slope)
        return slope

    def slopes(self, weight: Array, errors: Slopes | None = None) -> Array:
        """Derivatives of sum(weight y), weight (positions, units), by `gradient.NAMES`.

        `errors` replace the standardised errors of the population.
        """
        drawn = self.population
        if self.fitted is not None:
            by_unit = np.where(self.fitted.follows, weight.sum(axis=0), 0.0) / len(weight)
            weight = weight - by_unit + by_unit.mean()
        standardised = errors or drawn.slopes
        if self.meeting is not None:
            return self.meeting.slopes(drawn.lattice, self.table, standardised, weight)
        slopes = pull_back(drawn.lattice, self.table, self.touch, standardised, weight)
        if self.seats is not None:
            slopes += self.seats.slopes(weight, self.touch, self.table, standardised)
        return slopes
