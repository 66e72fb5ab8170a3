"""One RV reducer under load, by the names of configurations: stiffness and a few part errors.

Shared by the models `rv_transmission` and `rv_lost_motion`. Every error is zero by default: a
perfect unit, with the modification and the two stiffnesses of the loaded contact.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from ...declarations import Parameter, Value, number
from ...errors import Fault
from ...units import ARCMIN, MM, MRAD, UM
from ..gear import RV_40E, Gear, of_ratio
from . import declared
from .contact import declared as contact
from .contact.contact import LoadedContact, turn_angles
from .contact.errors import PartErrors
from .contact.geometry import ContactGeometry
from .contact.mesh import Mesh

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


def _assumed(name: str, default: float, unit: str, meaning: str, source: str, high: float) -> Parameter:
    return Parameter(name, default, unit, meaning, source, assumed=True, low=0.0, high=high, open_low=True)


PARAMETERS: tuple[Parameter, ...] = (
    *(parameter for parameter in declared.PARAMETERS if parameter.name in _GEOMETRY),
    *(parameter for parameter in contact.PARAMETERS if parameter.name in ("dr_rp_mm", "dr_p_mm")),
    _assumed(
        "normal_stiffness_N_per_um",
        200.0,
        "",
        "stiffness [N/um] of a pin contact along its normal",
        "linear in place of the stiffness of the line contact",
        1e6,
    ),
    _assumed(
        "series_stiffness_Nm_per_arcmin",
        58.5,
        "",
        "stiffness [N m/arcmin] between a disc and the carrier",
        "gives the unit the catalogue's 108 N m/arcmin",
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


def loaded_unit(parameters: Mapping[str, Value]) -> LoadedUnit:
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
    return of_ratio(int(pins), int(teeth), ratio) if pins > teeth else RV_40E
