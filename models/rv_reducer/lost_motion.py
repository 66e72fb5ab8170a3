"""One RV reducer under load, by the names of configurations, and the model `rv_lost_motion`: the twist of an
output that is loaded and unloaded while the input is locked.

The declarations are those of the model `rv_transmission` as well. Every error is zero by default: a
perfect unit, with the modification and the two stiffnesses of the loaded contact.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import pi
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...errors import Fault, raise_all
from ...section import Array, Output, Parameter, Value, number
from ...units import ARCMIN, MM, MRAD, UM
from ..gear import RV_40E, Gear, rv_teeth_of_ratio
from ..inputs import Distribution
from ..measurable import NO_CHANGES, Changeable, Column, MeasurableModel, Outside, Role
from . import declared
from .contact import declared as contact
from .contact.contact import LoadedContact, turn_angles, warn_of_overload
from .contact.geometry import ContactGeometry, Mesh, PartErrors
from .declared import Rows, outside
from .dynamics import NEGLIGIBLE_AMPLITUDE, OrderTable

_GEOMETRY = (
    "pin_circle_radius_mm",
    "pin_radius_mm",
    "eccentricity_mm",
    "cycloid_teeth",
    "pins",
    "reduction_ratio",
    "centre_distance_mm",
)


def _error(name: str, unit: str, meaning: str, high: float, signed: bool = True) -> Parameter:
    low = -high if signed else 0.0
    return Parameter(name, 0.0, unit, meaning, "a perfect unit", low=low, high=high)


def _assumed_parameter(name: str, default: float, unit: str, meaning: str, source: str, high: float) -> Parameter:
    return Parameter(name, default, unit, meaning, source, assumed=True, low=0.0, high=high, open_low=True)


PARAMETERS: tuple[Parameter, ...] = (
    *(parameter for parameter in declared.PARAMETERS if parameter.name in _GEOMETRY),
    *(parameter for parameter in contact.PARAMETERS if parameter.name in ("dr_rp_mm", "dr_p_mm")),
    _assumed_parameter(
        "normal_stiffness_N_per_um",
        200.0,
        "",
        "stiffness [N/um] of a pin contact along its normal",
        "linear in place of the stiffness of the line contact",
        1e6,
    ),
    _assumed_parameter(
        "series_stiffness_Nm_per_arcmin",
        58.5,
        "",
        "stiffness [N m/arcmin] between a disc and the carrier",
        "gives the RV-40E-121 its catalogue's 108 N m/arcmin",
        1e6,
    ),
    _error("sharing_percent", "percent", "series stiffness of disc 1 above the mean, disc 2 below", 90.0),
    _error(
        "bearing_variation_percent",
        "percent",
        "variation of the series stiffness with the crank's angle to the carrier, twice per turn of the crank",
        90.0,
    ),
    _error(
        "pin_circle_runout_um", "um", "distance of the pin circle's centre from the main bearing's", 100.0, signed=False
    ),
    _error("pin_circle_phase_deg", "deg", "direction in the housing of the displacement of the pin circle", 360.0),
    _error("pin_radius_um", "um", "radius of pin 1 alone, over its full length", 50.0),
    _error("pin_radius_disc_1_um", "um", "radius of pin 1 alone, at disc 1 only", 50.0),
    _error("eccentric_phase_1_mrad", "mrad", "phase of crank 1's eccentric for disc 1", 20.0),
    _error(
        "eccentric_phase_2_mrad",
        "mrad",
        "phase of crank 1's eccentric for disc 2; equal to that for disc 1, it is a phase of the whole crank",
        20.0,
    ),
    _error("eccentricity_1_um", "um", "eccentricity error of crank 1's eccentric for disc 1", 50.0),
    _error("eccentricity_2_um", "um", "eccentricity error of crank 1's eccentric for disc 2", 50.0),
    _error("disc_runout_um", "um", "runout of both discs (twice the distance of the centres)", 100.0, signed=False),
    _error("disc_pitch_um", "um", "cumulative pitch error of both discs", 100.0, signed=False),
    _error("stagger_arcmin", "arcmin", "angle by which disc 2 is turned ahead and disc 1 back", 5.0),
    _error("crank_bearing_um", "um", "radial clearance of the crank bearings", 50.0, signed=False),
)


@dataclass(frozen=True, slots=True)
class LoadedUnit:
    """A unit: the contact without its sharing of load, part errors, and the uneven stiffness.

    `sharing` is the excess of disc 1's series stiffness above the mean and the deficit of disc 2's,
    `variation` the amplitude of the stiffness twice per turn of the crank against the carrier; both
    relative.
    """

    contact: LoadedContact
    errors: PartErrors
    sharing: float = 0.0
    variation: float = 0.0

    def mesh(self, samples: int) -> Mesh:
        """The mesh at `samples` output angles over one turn."""
        geometry = self.contact.geometry
        angles = turn_angles(samples, geometry.nominal.cycloid_teeth)
        crank = 2.0 * pi * (geometry.nominal.cycloid_teeth + 1) * np.arange(samples) / samples
        uneven = 1.0 + self.sharing * np.array([1.0, -1.0])
        uneven = uneven * (1.0 + self.variation * np.cos(2.0 * crank)[:, None])
        series = np.asarray(self.contact.series_stiffness) * uneven
        return replace(self.contact, series_stiffness=series).mesh(self.errors, angles)


def _numbers(parameters: Mapping[str, Value]) -> dict[str, float]:
    return {parameter.name: number(parameters.get(parameter.name, parameter.default)) for parameter in PARAMETERS}


def unit_under_load(parameters: Mapping[str, Value]) -> LoadedUnit:
    """The unit of `parameters` by declared name; omitted ones keep their defaults."""
    p = _numbers(parameters)
    geometry = ContactGeometry(declared.nominal_geometry(p), dr_rp=p["dr_rp_mm"] * MM, dr_p=p["dr_p_mm"] * MM)
    pins_and_discs = LoadedContact(
        geometry,
        normal_stiffness=p["normal_stiffness_N_per_um"] / UM,
        series_stiffness=p["series_stiffness_Nm_per_arcmin"] / ARCMIN,
    )
    sharing, variation = p["sharing_percent"] / 100.0, p["bearing_variation_percent"] / 100.0
    return LoadedUnit(pins_and_discs, _part_errors(p, geometry), sharing, variation)


def faults(parameters: Mapping[str, Value]) -> list[Fault]:
    """Parameters without a contact: an undercut profile, pins that do not fit the teeth."""
    p = _numbers(parameters)
    problems, geometry = [], declared.nominal_geometry(p)
    if geometry.pins != geometry.cycloid_teeth + 1:
        text = f"must be one more than cycloid_teeth, got {geometry.pins} and {p['cycloid_teeth']}"
        problems.append(Fault("parameters.pins", text))
    return problems + declared.undercut(geometry)


def _part_errors(p: Mapping[str, float], geometry: ContactGeometry) -> PartErrors:
    pin = np.zeros((1, geometry.discs, geometry.pins))
    pin[0, :, 0] = p["pin_radius_um"] * UM
    pin[0, 0, 0] += p["pin_radius_disc_1_um"] * UM
    phase, eccentricity = np.zeros((2, 1, geometry.cranks, geometry.discs))
    phase[0, 0] = p["eccentric_phase_1_mrad"] * MRAD, p["eccentric_phase_2_mrad"] * MRAD
    eccentricity[0, 0] = p["eccentricity_1_um"] * UM, p["eccentricity_2_um"] * UM
    turn = p["stagger_arcmin"] * ARCMIN
    return PartErrors(
        pin_radius=pin,
        crank_phase=phase,
        eccentricity=eccentricity,
        disc_offset=np.full((1, 1), 0.5 * p["disc_runout_um"] * UM),
        pitch=np.full((1, 1), p["disc_pitch_um"] * UM),
        angle=np.array([[-turn, turn]]),
        bearing_clearance=np.full((1, 1, 1), p["crank_bearing_um"] * UM),
        circle_offset=np.array([p["pin_circle_runout_um"] * UM]),
        circle_phase=np.array([np.radians(p["pin_circle_phase_deg"])]),
    )


def gear_of(parameters: Mapping[str, object]) -> Gear:
    """The orders of the unit that these parameters describe; omitted ones keep their defaults."""
    names = ("pins", "cycloid_teeth", "reduction_ratio")
    values = {parameter.name: parameter.default for parameter in PARAMETERS if parameter.name in names}
    for name in names:
        value = parameters.get(name)
        if isinstance(value, int | float) and value > 0:
            values[name] = value
    pins, teeth, ratio = (number(values[name]) for name in names)
    return rv_teeth_of_ratio(int(pins), int(teeth), ratio) if pins > teeth else RV_40E


# Quantities of a loaded unit that effects may change, and the first-order change of the twist.


def _part_error(name: str, pattern: object) -> Callable[[LoadedUnit, float], LoadedUnit]:
    """The change that adds `pattern` times an amount to a part error of the unit."""

    def apply(unit: LoadedUnit, amount: float) -> LoadedUnit:
        added = amount * np.asarray(pattern, dtype=float)
        errors = np.asarray(getattr(unit.errors, name), dtype=float)
        errors = errors.reshape((1,) * (added.ndim - errors.ndim) + errors.shape)
        return replace(unit, errors=replace(unit.errors, **{name: errors + added}))

    return apply


def _sharing(unit: LoadedUnit, amount: float) -> LoadedUnit:
    return replace(unit, sharing=unit.sharing + amount)


def _series(unit: LoadedUnit, amount: float) -> LoadedUnit:
    stiffness = np.asarray(unit.contact.series_stiffness) * (1.0 + amount)
    return replace(unit, contact=replace(unit.contact, series_stiffness=stiffness))


_pin_circle = _part_error("circle_radius", [1.0])
_equidistance = _part_error("equidistance", [[1.0]])
_bearing = _part_error("bearing_clearance", [[[1.0]]])
_phase_1 = _part_error("crank_phase", [[[1.0, 0.0], [0.0, 0.0]]])
_phase_2 = _part_error("crank_phase", [[[0.0, 1.0], [0.0, 0.0]]])
_stagger = _part_error("angle", [[-1.0, 1.0]])


@dataclass(frozen=True, slots=True)
class Change:
    """A changeable quantity: its unit in SI, and the steps of its finite difference, in `unit`."""

    name: str
    unit: str
    meaning: str
    si: float
    low: float
    high: float
    apply: Callable[[LoadedUnit, float], LoadedUnit]

    def applied(self, unit: LoadedUnit, amount: float) -> LoadedUnit:
        """The unit with the quantity changed by `amount`, in the quantity's unit."""
        return self.apply(unit, amount * self.si)


CHANGES = (
    Change("pin_circle_radius_um", "um", "radius of the pin circle", UM, -1.0, 1.0, _pin_circle),
    Change("equidistance_um", "um", "equidistance modification of both discs", UM, -1.0, 1.0, _equidistance),
    Change("crank_bearing_um", "um", "radial clearance of the crank bearings", UM, 0.0, 1.0, _bearing),
    Change(
        "sharing_percent",
        "percent",
        "series stiffness of disc 1 above the mean, disc 2 below",
        0.01,
        -2.0,
        2.0,
        _sharing,
    ),
    Change("series_stiffness_percent", "percent", "series stiffness of both discs", 0.01, -2.0, 2.0, _series),
    Change("eccentric_phase_1_mrad", "mrad", "phase of crank 1's eccentric for disc 1", MRAD, -0.1, 0.1, _phase_1),
    Change("eccentric_phase_2_mrad", "mrad", "phase of crank 1's eccentric for disc 2", MRAD, -0.1, 0.1, _phase_2),
    Change(
        "stagger_arcmin",
        "arcmin",
        "angle by which disc 2 is turned ahead and disc 1 back",
        ARCMIN,
        -0.01,
        0.01,
        _stagger,
    ),
)
"""First-order responses are within a few percent of the exact change for changes of the size of a
tolerance under load (docs/transmission_error.md)."""

CHANGEABLE = tuple(Changeable(change.name, change.unit, change.meaning) for change in CHANGES)


class Responses:
    """First-order responses of the twist to changes, computed at their first use."""

    def __init__(self, unit: LoadedUnit, samples: int, most: float) -> None:
        self.unit, self.samples, self.most = unit, samples, most
        self._cached: dict[str, OrderTable] = {}

    def table(self, name: str) -> OrderTable:
        """d twist/d quantity [rad per unit], by order and torque."""
        if name not in self._cached:
            change = next(candidate for candidate in CHANGES if candidate.name == name)
            low, high = (
                OrderTable.of(change.applied(self.unit, amount).mesh(self.samples), self.most, left_out=0.0)
                for amount in (change.low, change.high)
            )
            self._cached[name] = high.difference(low, change.high - change.low, NEGLIGIBLE_AMPLITUDE)
        return self._cached[name]

    def of(self, changes: Mapping[str, Any], rows: int) -> list[tuple[OrderTable, Array]]:
        """Table and amount (n,) of every change that is not zero.

        Raises InputError for names that are not changeable and amounts that are not finite.
        """
        amounts = {name: np.broadcast_to(np.asarray(amount, dtype=float), rows) for name, amount in changes.items()}
        known = {change.name for change in CHANGES}
        raise_all(
            [
                *(
                    Fault(name, f"cannot be changed; the changeable quantities are {', '.join(sorted(known))}")
                    for name in amounts
                    if name not in known
                ),
                *(Fault(name, "must be finite") for name, amount in amounts.items() if not np.all(np.isfinite(amount))),
            ]
        )
        return [(self.table(name), amount) for name, amount in amounts.items() if amount.any()]


# Twist of an RV reducer whose input is locked while its output is loaded and unloaded.


SAMPLES_PER_PIN = 50
"""Enough for 0.01 arcmin: the order of the mesh of one tooth (1560, 0.006') is not resolved."""
REACH = 1.25
"""The tables reach this multiple of the momentary torque; beyond it they are linear."""


class RvLostMotion(MeasurableModel):
    """Twist of the output against a torque, input locked: loaded contact, without hysteresis.

    Tabulated by order of the output angle over torque, for any angle and torque. With
    clearance, a measurement without torque stays on the flank that was loaded last (`direction` -1:
    torque was positive), or is the middle of the clearance where no direction is given.
    """

    columns = (
        Column("torque_Nm", "Nm", "torque on the output", role=Role.TORQUE),
        Column(
            "direction",
            "",
            "sign of dT/dt; acts through effects, and where the torque is 0",
            False,
            role=Role.DIRECTION,
        ),
        Column("output_angle_deg", "deg", "angle of the output; omitted: the mean over a turn", False, role=Role.ANGLE),
        Column("temperature_C", "C", "temperature; acts through effects only", False, role=Role.TEMPERATURE),
    )
    outputs = (Output("twist_arcmin", "arcmin", "twist of the output, with the torque's sign"),)
    parameters = PARAMETERS
    free: ClassVar[Mapping[str, float]] = {}
    changeable = CHANGEABLE
    gear = RV_40E
    corrects: ClassVar[tuple[str, ...]] = ("rv_backlash", "rv_reducer")

    def __init__(
        self,
        parameters: Mapping[str, Value] | None = None,
        designs: Mapping[str, float] | None = None,
        inputs: Mapping[str, Distribution] | None = None,
    ) -> None:
        values = parameters or {}
        raise_all(faults(values))
        self.unit = unit_under_load(values)
        self.gear = gear_of(values)
        samples = SAMPLES_PER_PIN * self.unit.contact.geometry.pins
        self.momentary = self.unit.contact.momentary_torque
        most = REACH * self.momentary
        self.static = OrderTable.of(self.unit.mesh(samples), most, NEGLIGIBLE_AMPLITUDE)
        self.responses = Responses(self.unit, samples, most)

    @classmethod
    def gear_of(cls, parameters: Mapping[str, Any]) -> Gear | None:
        return gear_of(parameters)

    def outside(self, table: Mapping[str, NDArray[Any]]) -> Outside:
        return outside(table, self.momentary)

    def predict(
        self, table: Mapping[str, NDArray[Any]], rng: np.random.Generator, changes: Mapping[str, Array] = NO_CHANGES
    ) -> dict[str, Array]:
        rows = Rows.of(table)
        warn_of_overload(rows.torque, self.momentary)
        twist = _twist(self.static, rows)
        for response, amount in self.responses.of(changes, len(rows)):
            twist = twist + amount * _twist(response, rows)
        return {"twist_arcmin": twist / ARCMIN}


def _twist(orders: OrderTable, rows: Rows) -> Array:
    """Twist (n,) [rad] on the flank of the torque or of the direction, or the mean of both."""
    if not rows.angled:
        orders = orders.mean_only()
    last = np.zeros(len(rows)) if rows.direction is None else -rows.direction
    sign = np.where(rows.torque == 0.0, last, np.sign(rows.torque))
    twist = orders.twist(rows.angle, rows.torque, np.where(sign >= 0.0, 0, 1), None)
    if np.all(sign != 0.0):
        return twist
    opposite = orders.twist(rows.angle, rows.torque, np.where(sign > 0.0, 0, 1), None)
    return np.asarray(0.5 * (twist + opposite))
