"""Parameters and variables of `rv_reducer`, by the names of configurations."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from ...errors import Fault
from ...models.costs import Reciprocal
from ...models.inputs import Uniform
from ...models.rv_reducer import declared
from ...models.rv_reducer.contact import declared as contact
from ...models.rv_reducer.contact.contact import interference, shape_faults
from ...models.rv_reducer.contact.geometry import ContactGeometry
from ...models.rv_reducer.population.errors import nearest_prime, shares_a_factor, spreads_evenly
from ...models.rv_reducer.population.measures import INTERFERENCE
from ...models.rv_reducer.population.units import BEARING_PLAY_FACTOR, GEARS, PITCH_SPECTRUM, Coupling
from ...section import Kind, Need, Output, Parameter, Value, Variable, number, too_many
from ...units import MM, UM
from ..declaration import Declaration, Interval
from ..rv_backlash.problem import DEFAULT_COSTS
from ..rv_backlash.problem import DEFAULT_LIMITS as LIMITS_OF_B
from ..settings import Bound, Settings

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


def _wear(name: str, default: float, unit: str, meaning: str) -> Parameter:
    open_low = name == "running_in_hours"
    return Parameter(name, default, unit, meaning, "", low=0.0, high=1e6, open_low=open_low)


HELD = {
    "pin_circle_radius": 1.0,
    "pin_position": 1.0,
    "pin_hole_radius": 0.8,
    "pin_radius": 0.25,
    "pitch": 1.5,
    "runout": 1.0,
    "eccentricity": 1.0,
    "equidistance": 1.0,
    "shift": 1.0,
}
"""Half-widths [um] that precision grinding, jig grinding and centreless grinding with sorting hold [assumed]."""
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
    PITCH_SPECTRUM,
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
        "assumptions",
        "usual",
        "",
        "which assumptions are changed, one at a time, to state what they cost; all: laws, errors between discs, "
        "temperature, tooth thickness, stiffness and positions too, at a multiple of the time",
        "",
        choices=("usual", "all"),
    ),
    Parameter(
        "held_um",
        HELD,
        "um",
        "half-widths that processes hold; a point with a tighter one is remarked on",
        _A,
        assumed=True,
        choices=tuple(HELD),
        low=0.0,
        high=1000.0,
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
    _wear("wear_um_per_1000h", 0.0, "um", "flank wear of tooth and pin together in 1000 h after running in"),
    _wear("running_in_um", 0.0, "um", "flank wear of tooth and pin together while they run in"),
    _wear("running_in_hours", 200.0, "h", "time constant of running in"),
    _wear("hours", 0.0, "h", "hours of operation after which units are evaluated"),
    Parameter(
        "load_torque_Nm",
        0.0,
        "Nm",
        "torque under which the greatest pin force is computed; 0: the rated torque",
        "",
        low=0.0,
        high=1e7,
    ),
    Parameter(
        "pin_friction",
        0.08,
        "",
        "coefficient of friction between teeth and pins that do not turn, of running_torque_Nm alone",
        _A,
        assumed=True,
        low=0.0,
        high=1.0,
    ),
    BEARING_PLAY_FACTOR,
    Parameter(
        "over_constraint",
        False,
        "",
        "whether a disc sits on all of its cranks at once, so that errors of the distances of bores, journals and "
        "crank holes take up the play of the bearings or jam them",
        "",
        assumed=True,
        readings={declared.PRINTED: False},
    ),
    Parameter(
        "planet_coupling",
        False,
        "",
        "whether two cranks turn apart within the play of their bearings, each as far as its planet allows, instead of "
        "the tighter planet holding both",
        "",
        assumed=True,
        readings={declared.PRINTED: False},
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

_DOCUMENT = {p.name: p for p in declared.PARAMETERS}
PARAMETERS: tuple[Parameter, ...] = (
    *(_DOCUMENT[name] for name in _SHARED if name in _DOCUMENT),
    *(p for p in declared.PARAMETERS if p.name.endswith("_mid_um")),
    *(p for p in contact.PARAMETERS if p.name in _CONTACT),
    *CONTACT,
)
DISC_TO_DISC = {"circle_offset_um": 3.0, "bore_um": 2.0, "crank_phase_mrad": 2.0 / 1.3}
"""Errors that no document lists, at the values that they are fixed to unless they are searched."""
UNLISTED = DISC_TO_DISC | {"crank_hole_um": 2.0}
"""The same, with those that count where discs are coupled to all of their cranks."""


def _disc_variable(name: str, unit: str, low: float, high: float, meaning: str) -> Variable:
    return Variable(
        name,
        unit,
        Kind.HALF_WIDTH,
        low,
        high,
        meaning,
        UNLISTED[name],
        valid_low=0.0,
        valid_high=1000.0,
        random=True,
        assumed="no document lists this error",
    )


VARIABLES: tuple[Variable, ...] = (
    *(replace(v, high=0.4) if v.name == "stagger_arcmin" else v for v in declared.VARIABLES),
    _disc_variable("circle_offset_um", "um", 0.5, 10.0, "offset of the pin circle from the axis of the carrier"),
    _disc_variable("bore_um", "um", 0.5, 10.0, "position of the crank bores in a disc, either direction"),
    _disc_variable("crank_phase_mrad", "mrad", 0.3, 10.0, "phase of each journal of a crankshaft"),
)


# Tooth thickness of sun and planets apart from their grade: declared where a configuration states it.


THICKNESS = tuple(
    Variable(
        f"thickness_{gear}_um",
        "um",
        Kind.HALF_WIDTH,
        1.0,
        15.0,
        f"base tangent length of the {gear}, by Es_s, its allowance, to Es_s + 2 t below nominal",
        valid_low=0.0,
        valid_high=1000.0,
    )
    for gear in GEARS
)
"""The search ranges are assumptions."""
ALLOWANCES = {
    variable.name: Parameter(
        f"thickness_allowance_{gear}_um",
        20.0,
        "um",
        f"allowance |Es_s| of the base tangent length of the {gear}",
        "",
        assumed=True,
        low=0.0,
        high=1000.0,
    )
    for gear, variable in zip(GEARS, THICKNESS, strict=True)
}
"""Assumed: at 20 um each, gears of grade 6 do not jam and gears of grade 7 do."""
FLANK_CLEARANCE = Output(
    "flank_clearance_min_um", "um", "least flank clearance j_nmin of the involute stage", larger_is_better=True
)
"""Below 0, a sun and a planet within their limits may jam."""
COSTS_OF_THICKNESS = {"thickness_sun_um": Reciprocal(a=0.05, b=1.0), "thickness_planet_um": Reciprocal(a=0.1, b=2.0)}
"""Assumed: +-5 um cost 0.2 a gear, of which one is a sun and two are planets."""


# Pins that are sorted into classes and fitted to units: declared where a configuration states their number.


SORTING = (
    Parameter(
        "pin_classes",
        5,
        "",
        "classes that pins are sorted into by their diameter; a unit takes the class that its measured clearance needs",
        "",
        low=2,
        high=50,
    ),
    Parameter(
        "pin_class_um",
        1.0,
        "um",
        "width of a class, of diameters",
        "",
        assumed=True,
        low=0.0,
        high=100.0,
        open_low=True,
    ),
    Parameter(
        "pin_match_um",
        0.3,
        "um",
        "standard deviation with which the diameter that a unit needs is known",
        "",
        assumed=True,
        low=0.0,
        high=100.0,
    ),
    Parameter("pin_sorting_price", 0.0, "", "cost of sorting the pins of a unit", "", assumed=True, low=0.0, high=1e9),
)
OF_SORTING = (
    Output(
        "pins_left_over_percent",
        "percent",
        "pins of classes that fewer units need than are made, as many of each class",
        low=0.0,
        high=100.0,
    ),
    Output(
        "cost_per_good_unit", "", "cost with the pins left over, of each unit that keeps the yield's limit", low=0.0
    ),
)


def with_sorting(plain: Declaration, stated: Collection[str]) -> Declaration:
    """The declaration with classes of pins, where their number is `stated`."""
    if SORTING[0].name not in stated:
        return plain
    return replace(plain, parameters=(*plain.parameters, *SORTING), outputs=(*plain.outputs, *OF_SORTING))


def sorting_faults(given: Settings, asked: Iterable[str]) -> Iterator[Fault]:
    """Faults of classes of pins, and of what is not known with them; `asked` are objectives and limits."""
    p = {parameter.name: number(given.parameters.get(parameter.name, parameter.default)) for parameter in SORTING}
    if p["pin_class_um"] < 2.0 * p["pin_match_um"]:
        text = (
            f"classes of {p['pin_class_um']:g} um are narrower than the measurement can tell: the diameter that a unit "
            f"needs is known to {p['pin_match_um']:g} um, so that {2.0 * p['pin_match_um']:g} um is the least width"
        )
        yield Fault("parameters.pin_class_um", text)
    pins = given.variables.get("pin_radius_um")
    zone = 0.25 * p["pin_classes"] * p["pin_class_um"]
    if pins is not None and ((pins.low, pins.high) != (None, None) or pins.value not in (None, zone)):
        text = "follows from pin_classes times pin_class_um, the zone of the pins before they are sorted: leave it out"
        yield Fault("variables.pin_radius_um", text)
    if pins is not None and pins.distribution is not None and pins.distribution != Uniform():
        yield Fault("variables.pin_radius_um.distribution", "must be uniform where pins are sorted into classes")
    if number(given.parameters.get("share_pins", 0.0)) > 0.0:
        yield Fault("parameters.share_pins", "must be 0 where the pins of a unit are of one class: it is their share")
    if "pin_radius_um" in given.machines:
        yield Fault(
            "variables.pin_radius_um.machine", "pins that are sorted into classes have no machines: leave it out"
        )
    if given.effects or number(given.parameters.get("hours", 0.0)) > 0.0:
        text = "pins are fitted to new units at 20 degC: what effects or wear do to such units is not known here"
        yield Fault("parameters.pin_classes", text)
    text = "is evaluated where pins are fitted to units, but its derivatives are not known: limit the backlash"
    yield from _faults_of_asked(given, asked, SAMPLED_UNDER_LOAD, text)
    text = "is counted on reported units alone: minimise the cost, and read it there"
    yield from _faults_of_asked(given, asked, [output.name for output in OF_SORTING], text)


def _faults_of_asked(given: Settings, asked: Iterable[str], of: Collection[str], text: str) -> Iterator[Fault]:
    """A fault of every limit or objective that is one `of` these outputs."""
    for name in dict.fromkeys(asked):
        if name in of:
            yield Fault(f"limits.{name}" if name in given.limits else "objectives.minimise", f"{name} {text}")


def distance_faults(given: Settings, asked: Iterable[str]) -> Iterator[Fault]:
    """Faults of what is asked for under load where cranks have wrong distances, which do not act on it."""
    text = "is known of cranks at true distances alone: limit backlash_max_arcmin or jam_force_N instead, or set "
    text += "parameters.over_constraint = false"
    yield from _faults_of_asked(given, asked, SAMPLED_UNDER_LOAD, text)
    if given.parameters.get("interference") == "preload":
        remedy = 'set parameters.interference = "turn_mean", or parameters.over_constraint = false'
        yield Fault("parameters.interference", f"preload is known of cranks at true distances alone: {remedy}")


def with_thickness(plain: Declaration, stated: Collection[str]) -> Declaration:
    """The declaration with tolerances of the thickness of teeth, where some are `stated`."""
    more = tuple(variable for variable in THICKNESS if variable.name in stated)
    if not more:
        return plain
    return replace(
        plain,
        variables=(*plain.variables, *more),
        outputs=(*plain.outputs, FLANK_CLEARANCE),
        parameters=(*plain.parameters, *(ALLOWANCES[variable.name] for variable in more)),
        costs={**plain.costs, **{variable.name: COSTS_OF_THICKNESS[variable.name] for variable in more}},
        limits={**plain.limits, FLANK_CLEARANCE.name: Bound(low=0.0)},
        unconditional=plain.unconditional | {FLANK_CLEARANCE.name},
    )


# Outputs of `rv_reducer`, its default limits and objectives.


MEASURED = {
    "backlash_max_arcmin": "largest backlash of a unit over the positions of a turn",
    "backlash_mean_arcmin": "mean backlash of a unit over the positions of a turn",
}
"""What rigid units show, by output: each has a quantile, a mean and a standard deviation."""
ELASTIC = {
    "lost_motion_arcmin": "rotation between -3 % and +3 % of the rated torque, mean over the turn",
    "transmission_error_arcsec": "half the peak-to-peak transmission error over a turn, under te_torque_Nm",
    "preload_torque_Nm": "torque of the preloaded flanks without load, mean over the turn",
    "peak_pin_force_N": "largest force on a pin over the turn at the rated torque",
    "running_torque_Nm": "friction of the squeezed pins at the output without load, mean over the turn",
}
"""What units show under load, by output."""
B_OVER_A = "torsional stiffness between half and all of the rated torque (b/a), mean over the turn"


def _spread(name: str, meaning: str) -> tuple[Output, ...]:
    unit = name.rpartition("_")[2]
    return (
        Output(name, unit, f"{meaning}: one-sided quantile over units at the coverage", low=0.0),
        Output(f"{name}_mean", unit, f"mean over units of the {meaning}", low=0.0),
        Output(f"{name}_std", unit, f"standard deviation over units of the {meaning}", low=0.0),
    )


RIGID: tuple[Output, ...] = (
    Output("cost", "", "relative manufacturing cost, sum of the cost curves", low=0.0),
    *(output for name, meaning in MEASURED.items() for output in _spread(name, meaning)),
    Output("backlash_rms_arcmin", "arcmin", "root mean square of the backlash over units and positions", low=0.0),
    Output(
        "yield_percent",
        "%",
        "units whose largest backlash over the turn keeps backlash_limit_arcmin",
        100.0,
        larger_is_better=True,
        low=0.0,
        high=100.0,
    ),
    Output(
        "interference_probability",
        "",
        "probability of interference, as the parameter interference defines it; play of the crank bearings included",
        low=0.0,
        high=1.0,
    ),
    Output(
        "interference_share_of_turn",
        "",
        "fraction of all positions of all units at which flanks interfere",
        low=0.0,
        high=1.0,
    ),
    Output("overlap_p95_arcmin", "arcmin", "overlap that 95 % of the units stay below at every position", low=0.0),
    Output("phi_1_arcmin", "arcmin", "mean backlash of the involute stage", low=0.0),
    Output("radial_gap_mm", "mm", "clearance at tooth tip and root, dr_rp - dr_p", 0.03, larger_is_better=True),
    Output("modification_backlash_arcmin", "arcmin", "backlash that the modification itself leaves (first order)"),
)
UNDER_LOAD: tuple[Output, ...] = (
    *(output for name, meaning in ELASTIC.items() for output in _spread(name, meaning)),
    Output(
        "preload_torque_Nm_max",
        "Nm",
        "torque of the preloaded flanks without load, largest over the turn: one-sided quantile over units",
        low=0.0,
    ),
    *(
        Output(f"stiffness_Nm_arcmin{part}", "Nm/arcmin", f"{what} {B_OVER_A}", larger_is_better=best, low=0.0)
        for part, what, best in (
            ("", "what units at the coverage reach at least of the", True),
            ("_mean", "mean over units of the", True),
            ("_std", "standard deviation over units of the", False),
        )
    ),
)
PART = {"backlash_max_arcmin": "max", "backlash_mean_arcmin": "mean"}
MEASURES = {
    **{name: f"quantile {PART[name]}" for name in MEASURED},
    **{f"{name}_mean": f"mean {PART[name]}" for name in MEASURED},
    **{f"{name}_std": f"deviation {PART[name]}" for name in MEASURED},
    "backlash_rms_arcmin": "rms",
    "yield_percent": "yield",
    "interference_probability": "interference",
    "interference_share_of_turn": "interference share_of_turn",
    "overlap_p95_arcmin": "overlap",
}
"""The measure of each sampled output."""
SAMPLED = tuple(MEASURES)
"""Rigid outputs with a standard error."""
LOADED = {
    "lost_motion_arcmin": "lost_motion",
    "transmission_error_arcsec": "transmission_error",
    "preload_torque_Nm": "preload_torque",
    "preload_torque_Nm_max": "preload_torque_max",
    "peak_pin_force_N": "peak_pin_force",
    "stiffness_Nm_arcmin": "stiffness",
    "running_torque_Nm": "running_torque",
}
"""The elastic output that each output is a statistic of."""
LEAST = ("stiffness_Nm_arcmin",)
"""Of these, what the fraction `coverage` of the units reaches at least."""
SAMPLED_UNDER_LOAD = tuple(output.name for output in UNDER_LOAD)
OUTPUTS = (
    *RIGID,
    *UNDER_LOAD,
    *(
        Output(f"{output.name}_error", output.unit, "standard error of the sample", error_of=output.name)
        for output in (*RIGID, *UNDER_LOAD)
        if output.name in (*SAMPLED, *SAMPLED_UNDER_LOAD)
    ),
)
"""All outputs; those under load come after the rigid ones, the errors last."""


def part_of(name: str) -> tuple[str, str]:
    """An output under load, and which statistic of it is meant: quantile, mean or std."""
    for part in ("mean", "std"):
        if name.endswith(f"_{part}") and name.removesuffix(f"_{part}") in (*LOADED, JAM):
            return name.removesuffix(f"_{part}"), part
    return name, "quantile"


def is_unit_statistic(name: str) -> bool:
    """Whether an output is a statistic over units."""
    return name in MEASURES or part_of(name)[0] in (*LOADED, JAM)


DEFAULT_LIMITS = {name: bound for name, bound in LIMITS_OF_B.items() if name != "conjugate_clearance_min_mm"}
"""Radial gap at least 0.03 mm, and g1, g2, g4 of document B."""

DEFAULT_OBJECTIVES = ("cost", "backlash_max_arcmin")


# Discs on all of their cranks at once: declared where a configuration asks for it.


OF_COUPLING = (
    Parameter(
        "crank_bearing_stiffness_N_per_mm",
        0.0,
        "N/mm",
        "stiffness of a crank bearing beyond its clearance; 0: that which gives series_stiffness_Nm_per_arcmin",
        _A,
        assumed=True,
        low=0.0,
        high=1e9,
    ),
    Parameter(
        "measuring_torque_Nm",
        0.6,
        "Nm",
        "torque on a disc, in either sense, at which its backlash is read; the wind-up of bearings at true distances "
        "is deducted",
        _A,
        assumed=True,
        low=0.0,
        high=1e4,
        open_low=True,
    ),
)
LEAST_PULL_UM = 0.12
"""Squeeze [um] of one bearing by the measuring torque below which the rest of a disc is not found reliably."""
JAM = "jam_force_N"
OF_JAM = _spread(JAM, "force on a crank bearing by wrong distances of cranks, without load, largest over the turn")


def with_cranks(plain: Declaration, asked: bool) -> Declaration:
    """The declaration of discs on all of their cranks at once, where that is `asked` for."""
    if not asked:
        return plain
    meaning = "position of the crank holes in the carrier, either direction"
    errors = (
        Output(f"{output.name}_error", output.unit, "standard error of the sample", error_of=output.name)
        for output in OF_JAM
    )
    return replace(
        plain,
        variables=(*plain.variables, _disc_variable("crank_hole_um", "um", 0.5, 10.0, meaning)),
        outputs=(*plain.outputs, *OF_JAM, *errors),
        parameters=(*plain.parameters, *OF_COUPLING),
        performance=plain.performance | {output.name for output in OF_JAM},
    )


def coupling_faults(geometry: ContactGeometry, coupling: Coupling | None) -> Iterator[Fault]:
    """A fault of a torque that hardly presses the bearings."""
    if coupling is None or geometry.cranks == 2:  # two cranks rest in closed form
        return
    per_um = geometry.nominal.centre_distance * coupling.stiffness * UM
    if coupling.torque < LEAST_PULL_UM * per_um:
        text = (
            f"{coupling.torque:g} N m press one crank bearing by {coupling.torque / per_um:.2g} um, too little for a "
            f"disc on {geometry.cranks} cranks to rest firmly: give {LEAST_PULL_UM * per_um:.3g} at least, or softer "
            "bearings (parameters.crank_bearing_stiffness_N_per_mm)"
        )
        yield Fault("parameters.measuring_torque_Nm", text)


def planet_faults(parameters: Mapping[str, Value], sorted_pins: bool) -> list[Fault]:
    """Faults of planets that are coupled where that is not known; `sorted_pins`: pins are fitted to units."""
    wrong = {
        f"is known of two cranks, got {parameters['cranks']}": parameters["cranks"] != 2,
        "means nothing without an involute stage": not parameters["involute_stage"],
        "is known of cranks at true distances (over_constraint = false)": parameters["over_constraint"],
        "is not known where pins are fitted to units (pin_classes)": sorted_pins,
    }
    reasons = [reason for reason, holds in wrong.items() if holds and parameters["planet_coupling"]]
    return [Fault("parameters.planet_coupling", f"{reason}: leave it out, or the other") for reason in reasons]


# Faults of numbers of units and positions that are too large together.


def size_faults(count: Callable[[str], int], stored: int) -> list[Fault]:
    """A fault of every number of units whose measurements do not fit into memory.

    `count` gives a parameter by name, `stored` the evaluations that a search stores.
    """
    positions = count("positions")
    searched = count("search_positions") or positions
    per = {"search_units": (stored + 1) * searched, "report_units": positions, "elastic_units": count("te_positions")}
    messages = {name: too_many(count(name), MEASUREMENTS, number, "units x positions") for name, number in per.items()}
    return [Fault(f"parameters.{name}", text) for name, text in messages.items() if text]


# Refused before a search: settings under which the cheapest design is not meant.


HOLD_INTERFERENCE = {
    "interference_probability": 1.0,
    "interference_share_of_turn": 1.0,
    "overlap_p95_arcmin": np.inf,
    "preload_torque_Nm": np.inf,
    "preload_torque_Nm_max": np.inf,
    "preload_torque_Nm_mean": np.inf,
}
"""Outputs, a limit on any of which below these values holds interference."""


def unpriced_error_faults(searched: Collection[str], costs: Collection[str]) -> list[Fault]:
    """Errors between discs that are searched without a cost: the tightest would be free."""
    return [
        Fault(
            f"costs.{name}",
            f"is missing: {name} is searched, but a tight tolerance of it has no cost; give a curve, or fix it "
            f"(variables.{name}.value = {value:.4g})",
        )
        for name, value in UNLISTED.items()
        if name in searched and name not in costs
    ]


def unlimited_interference_faults(limits: Mapping[str, Bound], parameters: Mapping[str, Value]) -> list[Fault]:
    """No limit that holds the interference down, unless that is allowed."""
    held = [n for n in HOLD_INTERFERENCE if n in limits and limits[n].high < HOLD_INTERFERENCE[n]]
    if held or parameters["allow_interference"]:
        return []
    text = (
        "is missing: without a limit on interference or preload, backlash is closed by flanks that interfere, which "
        "costs nothing; set, for example, 0.05, or parameters.allow_interference = true"
    )
    return [Fault("limits.interference_probability", text)]


# Values that are still those of the RV-40E-121 where the geometry is not.


GEOMETRY = (
    "pin_circle_radius_mm",
    "pin_radius_mm",
    "eccentricity_mm",
    "cycloid_teeth",
    "pins",
    "reduction_ratio",
    "sun_pitch_radius_mm",
    "centre_distance_mm",
    "discs",
    "cranks",
    "involute_stage",
)
GEAR_DEVIATIONS = (
    "gear_runout_um",
    "base_pitch_deviation_um",
    "helix_deviation_um",
    "axis_parallelism_x_um",
    "axis_parallelism_y_um",
    "centre_distance_deviation_um",
    "thickness_deviation_upper_um",
    "thickness_deviation_lower_um",
)
STIFFNESS = ("normal_stiffness_N_per_mm", "series_stiffness_Nm_per_arcmin")
TORQUES = ("rated_torque_Nm", "momentary_torque_Nm")
OF_THE_STAGE = (
    "reduction_ratio",
    "sun_pitch_radius_mm",
    "pressure_angle_deg",
    "involute_cosine",
    "planet_share",
    *GEAR_DEVIATIONS,
    "involute_grade",
)
"""What means nothing without an involute stage."""
DEFAULTS = {p.name: p.default for p in PARAMETERS}


def changed_geometry_parameters(parameters: Mapping[str, Value]) -> tuple[str, ...]:
    """Parameters of the geometry that are not the RV-40E-121's."""
    without = () if parameters["involute_stage"] else OF_THE_STAGE
    return tuple(name for name in GEOMETRY if name not in without and parameters[name] != DEFAULTS[name])


def default_values_sentence(given: Settings, parameters: Mapping[str, Value]) -> tuple[str, ...]:
    """One sentence that names every such value, none where the geometry is the RV-40E-121's.

    `given` are the settings as the user gives them, `parameters` the complete ones. A value that
    the user gives counts as the user's own, also where it is the same.
    """
    new = changed_geometry_parameters(parameters)
    inherited = "; ".join(_groups(given, bool(parameters["involute_stage"]))) if new else ""
    return (f"{', '.join(new)} changed; still the RV-40E-121's: {inherited}",) if inherited else ()


def _groups(given: Settings, stage: bool) -> Iterator[str]:
    values = given.parameters
    mids = [name for name in DEFAULTS if name.endswith("_mid_um")]
    yield from _inherited_names("", (n for n in (*GEOMETRY[:-1], "pressure_angle_deg")), values, stage)
    yield from _inherited_names("gear deviations", GEAR_DEVIATIONS, values, stage)
    yield from _inherited_names("mid-limits", mids, values, stage)
    coupled = bool(values.get("over_constraint", False))
    more = (parameter.name for parameter in OF_COUPLING if coupled)
    yield from _inherited_names("", (*STIFFNESS, *TORQUES, *more), values, stage)
    ranges = [v.name for v in VARIABLES if v.name not in DISC_TO_DISC]
    yield from _inherited_names("search ranges", ranges, _stated_variables(given), stage)
    between = UNLISTED if coupled else DISC_TO_DISC
    yield from _inherited_names("errors between discs", between, _stated_variables(given), stage)
    yield from _inherited_names("costs", DEFAULT_COSTS, given.costs, stage)


def _inherited_names(group: str, names: Iterable[str], given: Mapping[str, object], stage: bool) -> Iterator[str]:
    """The names that are not given, all of a group by its name alone."""
    every = [name for name in names if stage or name not in OF_THE_STAGE]
    unstated = [name for name in every if name not in given]
    if group and unstated == every and unstated:
        yield f"all {len(unstated)} {group}"
    elif unstated:
        yield f"{group}: {', '.join(unstated)}" if group else ", ".join(unstated)


def _stated_variables(given: Settings) -> dict[str, object]:
    """Variables whose range or value is given."""
    return {
        name: setting
        for name, setting in given.variables.items()
        if (setting.value, setting.low, setting.high) != (None, None, None)
    }


# Reference allocations for a front of `rv_reducer`, all of them tested by contact.


_ZONES = (
    "pin_circle_radius_um",
    "pin_position_um",
    "pin_hole_radius_um",
    "pin_radius_um",
    "pitch_um",
    "runout_um",
    "eccentricity_um",
    "equidistance_um",
    "shift_um",
    "crank_bearing_um",
    "involute_grade",
    "stagger_arcmin",
    "dr_rp_mm",
    "dr_p_mm",
)


def _design(*values: float) -> dict[str, float]:
    return dict(zip(_ZONES, values, strict=True))


REFERENCES: dict[str, dict[str, float]] = {
    "document B": {},
    "document B, discs staggered by 0.2 arcmin each": {"stagger_arcmin": 0.2},
    "least cost at 1 arcmin by document B's closed form": _design(
        1.423, 1.275, 1.092, 0.469, 2.430, 1.454, 4.683, 0.618, 0.882, 0.839, 4, 0.0, -0.0474, -0.0863
    ),
    "document B's closed form by its genetic algorithm, staggered": _design(
        1.427, 1.123, 1.080, 0.496, 2.566, 1.505, 4.849, 0.665, 0.939, 0.834, 4, 0.3922, -0.03874, -0.0814
    ),
}
"""Designs by label; a variable that is left out has the document's value. The optimum of the closed
form is proven within 1 %; the staggered design is where a genetic algorithm of version 0.1 ended."""


# Faults and warnings of the geometry that a configuration states.


GEAR_PARAMETERS = range(8, 41)
"""Numbers of teeth of the sun gear with which a ratio of gears is sought."""
ROUNDING = 0.005
"""Part of a tooth by which a rounded reduction ratio may miss whole teeth of the planet."""
MAX_CRANK_CIRCLE_DEVIATION = 0.02
"""Fraction by which the crank circle may differ from the centre distance of the gears."""
LEAST_GAP_MM = 0.007
"""Radial gap [mm] below which pins that the population leaves out may close the backlash."""
LATTICES = ("positions", "search_positions", "te_positions")
WEAR = ("wear_um_per_1000h", "running_in_um")


def faults(geometry: ContactGeometry, given: Settings, ends: Mapping[str, Interval]) -> list[Fault]:
    """Every fault of the geometry; `ends` [mm] of `dr_rp_mm` and `dr_p_mm` are their ranges."""
    (_, most), (least, _) = ends["dr_rp_mm"], ends["dr_p_mm"]
    opened = replace(geometry, dr_rp=most * MM, dr_p=least * MM)
    shape = [
        *shape_faults(opened),
        *_ratio(geometry, given.parameters),
        *_cranks(geometry),
        *_unused_setting_faults(geometry, given),
    ]
    return shape or [*interference(opened, "variables.dr_p_mm")]


def _ratio(geometry: ContactGeometry, given: Mapping[str, Value]) -> Iterator[Fault]:
    place, ratio = "parameters.reduction_ratio", geometry.nominal.reduction_ratio
    teeth = geometry.nominal.cycloid_teeth
    if not geometry.involute_stage and number(given.get("reduction_ratio", teeth)) != teeth:
        text = f"without an involute stage it is the number of teeth of a disc, {teeth}"
        yield Fault(place, f"{text}, got {ratio:g}; leave it out")
    if geometry.involute_stage and ratio <= 1.0:
        text = "must be above 1: it is 1 + pins z2/z1, with the teeth of planet and sun"
        yield Fault(place, f"{text}, got {ratio:g}")


def _cranks(geometry: ContactGeometry) -> Iterator[Fault]:
    nominal = geometry.nominal
    root = nominal.pin_circle_radius - nominal.pin_radius - nominal.eccentricity
    if nominal.centre_distance >= root:
        yield Fault(
            "parameters.centre_distance_mm",
            f"the cranks stand on a radius of {nominal.centre_distance / MM:g} mm, outside of the discs, whose tooth "
            f"roots are at {root / MM:.4g} mm",
        )


def _unused_setting_faults(geometry: ContactGeometry, given: Settings) -> Iterator[Fault]:
    """Faults of settings for an involute stage that does not exist."""
    grade = given.variables.get("involute_grade")
    text = "there is no involute stage (parameters.involute_stage = false): leave it out"
    if not geometry.involute_stage and grade is not None and grade.value is None:
        yield Fault("variables.involute_grade", text)
    for name in (variable.name for variable in THICKNESS if variable.name in given.variables):
        if not geometry.involute_stage:
            yield Fault(f"variables.{name}", text)
    if not geometry.involute_stage and "involute_grade" in given.costs:
        yield Fault("costs.involute_grade", text)
    for name in (name for name in OF_THE_STAGE[1:] if name in DEFAULTS and not geometry.involute_stage):
        if given.parameters.get(name, DEFAULTS[name]) != DEFAULTS[name]:  # a resolved configuration has all of them
            yield Fault(f"parameters.{name}", text)


# ---------------------------------------------------------------- warnings


def warnings(geometry: ContactGeometry, parameters: Mapping[str, Value], radial_gap: Bound) -> Iterator[str]:
    """Warnings about geometries that are computed but questionable."""
    yield from _gears(geometry)
    for name in LATTICES:
        yield from _lattice(geometry, name, int(number(parameters[name])))
    if radial_gap.low < LEAST_GAP_MM:
        yield (
            f"no limit keeps radial_gap_mm at {LEAST_GAP_MM:g} mm or above: pins near tip and root may close the "
            "backlash of a nearly unmodified profile, and units are computed without these pins"
        )


def idle_wear(parameters: Mapping[str, Value]) -> Iterator[str]:
    """A warning of wear that has no hours to act in, as `hours` without wear are a fault."""
    stated = [name for name in WEAR if number(parameters[name])]
    if stated and not number(parameters["hours"]):
        yield (
            f"{', '.join(stated)}: nothing wears in 0 hours; state parameters.hours, or hours of a condition "
            "(of the machine, where it is nested in one)"
        )


def _gears(geometry: ContactGeometry) -> Iterator[str]:
    nominal = geometry.nominal
    if not geometry.involute_stage:
        return
    ratio = (nominal.reduction_ratio - 1.0) / nominal.pins
    formula = f"(reduction_ratio - 1)/pins = {ratio:.6g}"
    if all(abs(sun * ratio - round(sun * ratio)) > ROUNDING for sun in GEAR_PARAMETERS):
        yield (
            f"no pair of gears has the ratio z2/z1 = {formula} with {GEAR_PARAMETERS[0]} to "
            f"{GEAR_PARAMETERS[-1]} teeth of the sun: reduction_ratio and pins may contradict each other"
        )
    apart = nominal.sun_pitch_radius * (1.0 + ratio)
    if abs(apart / nominal.centre_distance - 1.0) > MAX_CRANK_CIRCLE_DEVIATION:
        yield (
            f"centre_distance_mm is {nominal.centre_distance / MM:g} mm, but planets of a sun of pitch radius "
            f"{nominal.sun_pitch_radius / MM:g} mm with z2/z1 = {formula} stand at {apart / MM:.4g} mm"
        )


def _lattice(geometry: ContactGeometry, name: str, positions: int) -> Iterator[str]:
    if positions <= 1 or spreads_evenly(positions, geometry):
        return
    nominal = geometry.nominal
    why = f"do not cover the turns of disc and cranks evenly ({nominal.cycloid_teeth} teeth)"
    if shares_a_factor(positions, geometry):
        why = (
            f"have a common factor with {nominal.cycloid_teeth} teeth or {nominal.pins} pins, so that the same phases "
            "of the mesh are repeated"
        )
    better = nearest_prime(positions, geometry)
    yield f"{name}: {positions} positions {why}, and the greatest backlash is underestimated; use {better}"
