"""Parameters and variables of `rv_reducer`, by the names of configurations."""

from __future__ import annotations

from dataclasses import replace

from ...counts import Need
from ...declarations import Kind, Parameter, Variable
from ...models.rv_reducer import declared as document
from ...models.rv_reducer.contact import declared as contact
from ...models.rv_reducer.population.measures import INTERFERENCE

_SHARED = (
    "pin_circle_radius_mm",
    "pin_radius_mm",
    "eccentricity_mm",
    "cycloid_teeth",
    "pins",
    "reduction_ratio",
    "sun_pitch_radius_mm",
    "centre_distance_mm",
    "pressure_angle_deg",
    "gear_runout_um",
    "base_pitch_deviation_um",
    "helix_deviation_um",
    "axis_parallelism_x_um",
    "axis_parallelism_y_um",
    "centre_distance_deviation_um",
    "thickness_deviation_upper_um",
    "thickness_deviation_lower_um",
    "thermal_expansion_per_K",
    "involute_cosine",
    "planet_share",
    "backlash_limit_arcmin",
)
_CONTACT = (
    "normal_stiffness_N_per_mm",
    "series_stiffness_Nm_per_arcmin",
    "discs",
    "cranks",
    "rated_torque_Nm",
    "momentary_torque_Nm",
)
_A = "no document prints it"


def _share(name: str, meaning: str) -> Parameter:
    return Parameter(
        name,
        0.0,
        "",
        f"fraction of the variance of {meaning} that is common to a unit; no value is the worst case",
        _A,
        assumed=True,
        low=0.0,
        high=1.0,
    )


def _count(name: str, default: int, meaning: str, low: int, high: int, need: Need | None = None) -> Parameter:
    return Parameter(name, default, "", meaning, "", low=low, high=high, need=need)


UNITS = Need("unit", bytes=2e3)
"""Its errors, drawn."""
MEASUREMENTS = Need("measurement", bytes=40.0)
"""Of one unit at one position: contact, and what its derivatives need."""
CONTACT: tuple[Parameter, ...] = (
    Parameter("involute_stage", True, "", "whether there is an involute stage before the cycloid stage", ""),
    _count(
        "positions",
        61,
        "positions of a turn of the output at which a unit is measured; the largest backlash grows with them",
        1,
        100_003,
    ),
    _share("share_pins", "the errors of pins and their holes"),
    _share("share_discs", "equidistance and shift of the discs"),
    Parameter(
        "interference",
        "turn_mean",
        "",
        "what interference_probability counts: units whose mean over the turn is below zero, the fraction of all "
        "positions of all units, units that overlap somewhere by more than overlap_arcmin, or units whose preload "
        "exceeds preload_percent_of_rated",
        _A,
        assumed=True,
        choices=INTERFERENCE,
    ),
    Parameter(
        "overlap_arcmin", 0.3, "arcmin", "overlap beyond which a unit interferes", _A, assumed=True, low=0.0, high=60.0
    ),
    Parameter(
        "preload_percent_of_rated",
        5.0,
        "percent",
        "preload torque beyond which a unit interferes, in percent of the rated torque",
        _A,
        assumed=True,
        low=0.0,
        high=1e3,
    ),
    Parameter(
        "allow_interference", False, "", "whether a search may go without a limit on interference or preload", ""
    ),
    Parameter(
        "te_torque_Nm",
        0.0,
        "Nm",
        "torque under which the transmission error is measured; 0: the rated torque",
        "",
        low=0.0,
        high=1e7,
    ),
    _count("te_positions", 251, "positions of a turn at which the transmission error is measured", 8, 10_007),
    _count(
        "search_units",
        0,
        "units of the sample that is searched on; 0: 512, and 2048 where there is one objective",
        0,
        1_048_576,
        UNITS,
    ),
    _count("search_positions", 0, "positions that are searched on; 0: those that are reported", 0, 100_003),
    _count("report_units", 4096, "fresh units on which every reported point is tested", 64, 4_194_304, UNITS),
    _count("elastic_units", 256, "units whose contact is solved under load", 16, 65_536, UNITS),
)

_DOCUMENT = {p.name: p for p in document.PARAMETERS}
PARAMETERS: tuple[Parameter, ...] = (
    *(_DOCUMENT[name] for name in _SHARED if name in _DOCUMENT),
    *(p for p in document.PARAMETERS if p.name.endswith("_mid_um")),
    *(p for p in contact.PARAMETERS if p.name in _CONTACT),
    *CONTACT,
)
DISC_TO_DISC = {"circle_offset_um": 3.0, "bore_um": 2.0, "crank_phase_mrad": 2.0 / 1.3}
"""Errors that no document lists, at the values that they are fixed to unless they are searched."""


def _new(name: str, unit: str, low: float, high: float, meaning: str) -> Variable:
    return Variable(
        name,
        unit,
        Kind.HALF_WIDTH,
        low,
        high,
        meaning,
        DISC_TO_DISC[name],
        valid_low=0.0,
        valid_high=1000.0,
        random=True,
        assumed="no document lists this error",
    )


VARIABLES: tuple[Variable, ...] = (
    *(replace(v, high=0.4) if v.name == "stagger_arcmin" else v for v in document.VARIABLES),
    _new("circle_offset_um", "um", 0.5, 10.0, "offset of the pin circle from the axis of the carrier"),
    _new("bore_um", "um", 0.5, 10.0, "position of the crank bores in a disc, either direction"),
    _new("crank_phase_mrad", "mrad", 0.3, 10.0, "phase of each journal of a crankshaft"),
)
