"""Parameters and variables of the RV backlash models, by the names of configurations.

Shared by the problem `rv_backlash` and the model `rv_batch`. Defaults are document B's RV-40E-121.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf, radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import Fault, raise_all
from ...section import READING, Array, Kind, Parameter, Value, Variable, completed, number
from ...units import ARCMIN, MM, UM
from ..inputs import Distribution
from ..measurable import Outside
from .backlash import Allocation, BacklashModel
from .cycloid import LINEAR_ERRORS, EccentricityLaw
from .geometry import InvoluteStage, RvGeometry
from .tighter_planet import TighterPlanet

# Interpretation of document B's formula: its corrections, each by one parameter.


CONSISTENT, PRINTED = "consistent", "printed"


def _corrected_parameter(
    name: str, default: Value, printed: Value, meaning: str, source: str, high: float = inf
) -> Parameter:
    """A parameter whose default differs from the printed interpretation of document B."""
    return Parameter(name, default, "", meaning, source, assumed=True, low=0.0, high=high, readings={PRINTED: printed})


READINGS: tuple[Parameter, ...] = (
    Parameter(
        READING,
        CONSISTENT,
        "",
        "consistent: document B's formula with its errors corrected; "
        "printed: the formula as printed, and as in version 0.1. It sets the defaults of eccentricity_factor, "
        "position_mids_count, sun_held, involute_cosine and planets",
        choices=(CONSISTENT, PRINTED),
    ),
    _corrected_parameter(
        "eccentricity_factor",
        1.0,
        2.0,
        "factor on the law of the eccentricity, factor/(e z_c) times the polynomial",
        "exact 40-pin geometry: 1",
        100.0,
    ),
    _corrected_parameter(
        "position_mids_count",
        False,
        True,
        "whether the mid-limits of pin position and pitch move the mean backlash",
        "a turn common to all pins causes no backlash",
    ),
    _corrected_parameter(
        "sun_held",
        True,
        False,
        "whether backlash is measured at the carrier with the sun held: the cranks then turn "
        "with the carrier, and phi_2 and phi_3 are 117/121 of the turn of the discs (derived "
        "from the teeth); otherwise they are the turn of the discs",
        "kinematics",
    ),
    _corrected_parameter(
        "involute_cosine",
        True,
        False,
        "whether phi_1 is j_n/(i r_1 cos(alpha)), because j_n is normal to the flanks; otherwise j_n/(i r_1)",
        "geometry of the involute",
    ),
    replace(
        _corrected_parameter(
            "planets", 2, 1, "number of planets; phi_1 is the least of their clearances", "as in document A", 12
        ),
        low=1,
    ),
    Parameter(
        "planet_share",
        0.5,
        "",
        "fraction of the variance of the planets' clearances (as normal scores) that is common to all",
        "all planets mesh with the same sun",
        assumed=True,
        low=0.0,
        high=1.0,
    ),
    Parameter(
        "stagger_gain",
        2.0,
        "",
        "phi_2 decreases by stagger_gain times stagger_arcmin: document B's 4 delta', where delta' is half the stagger",
        "document B",
        low=0.0,
        high=100.0,
    ),
)


ERRORS = (*LINEAR_ERRORS, "eccentricity")
"""The errors of the cycloid stage that have a half-width and a mid-limit."""
MAX_ECCENTRICITY_UM = 10.0
"""The eccentricity law is fitted up to here."""

_B = "document B"
_LAW = "exact 40-pin geometry of the RV-40E-121, with an eccentricity_factor of 1"
_MID_UM = {
    "pin_circle_radius": -1.0,
    "pin_position": -1.0,
    "pin_hole_radius": 2.5,
    "pin_radius": -1.0,
    "pitch": -3.0,
    "runout": 0.0,
    "eccentricity": 0.0,
    "equidistance": -1.0,
    "shift": 1.0,
}


def _printed_parameter(name: str, default: float, unit: str, meaning: str, high: float) -> Parameter:
    return Parameter(name, default, unit, meaning, _B, low=0.0, high=high, open_low=True)


def _integer_parameter(name: str, default: int, meaning: str, low: float, high: float) -> Parameter:
    return Parameter(name, default, "", meaning, _B, low=low, high=high)


def _size(name: str, default: float, unit: str, meaning: str, high: float) -> Parameter:
    source = "z1 = 12, z2 = 36, m = 1.5 mm"
    return Parameter(name, default, unit, meaning, source, assumed=True, low=0.0, high=high, open_low=True)


def _deviation(name: str, default: float, meaning: str) -> Parameter:
    meaning, source = f"{meaning}, at ISO grade 7", "typical of gears of this size"
    return Parameter(name, default, "um", meaning, source, assumed=True, low=0.0, high=1000.0)


def _mid(error: str) -> Parameter:
    assumed = error == "eccentricity"
    source = "the document prints no zone for the eccentricity" if assumed else _B
    bound = MAX_ECCENTRICITY_UM if assumed else 1000.0
    meaning = f"mid-limit of the {error.replace('_', ' ')} error"
    default = _MID_UM[error]
    return Parameter(f"{error}_mid_um", default, "um", meaning, source, assumed, low=-bound, high=bound)


PARAMETERS: tuple[Parameter, ...] = (
    *READINGS,
    _printed_parameter("pin_circle_radius_mm", 64.0, "mm", "radius r_p of the pin circle", 1e4),
    _printed_parameter("pin_radius_mm", 3.0, "mm", "radius r_rp of the pins", 1e3),
    _printed_parameter("eccentricity_mm", 1.3, "mm", "eccentricity e of the crankshafts", 1e3),
    _integer_parameter("cycloid_teeth", 39, "teeth z_c of a cycloid disc", 3, 1000),
    _integer_parameter("pins", 40, "pins z_p of the housing", 4, 1001),
    _printed_parameter("reduction_ratio", 121.0, "", "reduction ratio i, sun in, carrier out", 1e5),
    _size("sun_pitch_radius_mm", 9.0, "mm", "pitch radius r_1 of the sun gear", 1e4),
    _size("centre_distance_mm", 36.0, "mm", "centre distance a_0 (radius of crank circle)", 1e4),
    Parameter(
        "pressure_angle_deg",
        20.0,
        "deg",
        "pressure angle of the involute gears",
        "usual value",
        assumed=True,
        low=0.0,
        high=45.0,
        open_low=True,
    ),
    _deviation("gear_runout_um", 36.0, "runout F_r of sun and planet"),
    _deviation("base_pitch_deviation_um", 13.0, "base pitch deviation f_pb"),
    _deviation("helix_deviation_um", 11.0, "helix deviation F_beta"),
    _deviation("axis_parallelism_x_um", 11.0, "axis parallelism f_x"),
    _deviation("axis_parallelism_y_um", 5.5, "axis parallelism f_y"),
    _deviation("centre_distance_deviation_um", 19.5, "centre distance deviation f_a"),
    _deviation("thickness_deviation_upper_um", 56.0, "magnitude of E_ss of either gear"),
    _deviation("thickness_deviation_lower_um", 112.0, "magnitude of E_si of either gear"),
    Parameter(
        "eccentricity_linear",
        -0.055,
        "",
        "fraction of an eccentricity error that acts as play, first order",
        _LAW,
        assumed=True,
        low=-10.0,
        high=10.0,
    ),
    Parameter(
        "eccentricity_quadratic_per_mm", -12.6, "1/mm", "the same, second order", _LAW, assumed=True, low=-1e4, high=1e4
    ),
    Parameter(
        "thermal_expansion_per_K",
        11.5e-6,
        "1/K",
        "thermal expansion of disc and housing; used where their temperature is stated",
        "bearing steel",
        assumed=True,
        low=0.0,
        high=1e-3,
    ),
    *(_mid(error) for error in ERRORS),
    _printed_parameter("backlash_limit_arcmin", 1.0, "arcmin", "largest backlash of a conforming unit", 1e4),
)


def _half_width(error: str, low: float, high: float, document: float, meaning: str) -> Variable:
    return Variable(
        f"{error}_um",
        "um",
        Kind.HALF_WIDTH,
        low,
        high,
        meaning,
        document,
        mid=_MID_UM[error],
        valid_low=0.0,
        valid_high=1000.0,
        random=True,
    )


VARIABLES: tuple[Variable, ...] = (
    _half_width("pin_circle_radius", 0.5, 10.0, 3.0, "pin-circle radius r_p"),
    _half_width("pin_position", 0.5, 10.0, 2.0, "circumferential position of the pins"),
    _half_width("pin_hole_radius", 0.5, 8.0, 1.5, "radius of the pin holes"),
    _half_width("pin_radius", 0.25, 5.0, 1.0, "pin radius r_rp"),
    _half_width("pitch", 1.0, 15.0, 4.0, "cumulative pitch of the discs"),
    _half_width("runout", 0.25, 8.0, 1.0, "runout of the discs"),
    Variable(
        "eccentricity_um",
        "um",
        Kind.HALF_WIDTH,
        0.25,
        8.0,
        "eccentricity of the cranks",
        1.0,
        mid=_MID_UM["eccentricity"],
        valid_low=0.0,
        valid_high=MAX_ECCENTRICITY_UM,
        assumed="the document prints no zone for the eccentricity; +-1 um in every reference",
        random=True,
    ),
    _half_width("equidistance", 0.25, 6.0, 1.0, "equidistance modification of the ground profile"),
    _half_width("shift", 0.25, 6.0, 1.0, "shift modification of the ground profile"),
    Variable(
        "crank_bearing_um",
        "um",
        Kind.FULL_CLEARANCE,
        0.5,
        20.0,
        "clearance of the crank-arm bearings",
        2.0,
        valid_low=0.0,
        valid_high=1000.0,
        assumed="the document's table prints 0..0.002 mm, its Monte Carlo text 0..0.02 mm; "
        "only the table agrees with its figures",
        random=True,
    ),
    Variable(
        "involute_grade",
        "",
        Kind.GRADE,
        4,
        8,
        "ISO grade of sun and planets; deviations grow by sqrt(2) per grade",
        7,
        integer=True,
        valid_low=0.0,
        valid_high=12.0,
        random=True,
    ),
    Variable(
        "stagger_arcmin",
        "arcmin",
        Kind.NOMINAL,
        0.0,
        0.4,
        "angle by which the first disc is turned ahead and the second disc back",
        0.0,
        valid_low=0.0,
        valid_high=60.0,
    ),
    Variable(
        "dr_rp_mm", "mm", Kind.NOMINAL, -0.08, 0.0, "equidistance modification", -0.040, valid_low=-1.0, valid_high=1.0
    ),
    Variable("dr_p_mm", "mm", Kind.NOMINAL, -0.12, 0.0, "shift modification", -0.070, valid_low=-1.0, valid_high=1.0),
)


def backlash_model(
    parameters: Mapping[str, Value], mids_um: Mapping[str, float] | None, inputs: Mapping[str, Distribution]
) -> BacklashModel:
    """The model (SI) of `parameters` by declared name; omitted ones keep their defaults.

    `mids_um` replaces mid-limits by name of the error (`pin_radius`); `inputs` has distributions by
    the same names and `crank_bearing`, `involute_grade`.
    """
    values = completed(PARAMETERS, parameters)
    p = {parameter.name: number(values[parameter.name]) for parameter in PARAMETERS if parameter.name != READING}
    mids = {error: p[f"{error}_mid_um"] for error in ERRORS} | dict(mids_um or {})
    mid = {error: value * UM for error, value in mids.items()}
    return BacklashModel(
        nominal_geometry(p),
        _stage(p),
        _law(p),
        mid,
        dict(inputs),
        tighter=TighterPlanet(int(p["planets"]), p["planet_share"]),
        sun_held=bool(p["sun_held"]),
        stagger_gain=p["stagger_gain"],
        position_mids_count=bool(p["position_mids_count"]),
    )


def _law(p: Mapping[str, float]) -> EccentricityLaw:
    quadratic = p["eccentricity_quadratic_per_mm"] / MM
    return EccentricityLaw(p["eccentricity_linear"], quadratic, p["eccentricity_factor"])


def nominal_geometry(p: Mapping[str, float]) -> RvGeometry:
    """The geometry (SI) of parameters by declared name; omitted lengths keep their defaults."""
    lengths = ("pin_circle_radius", "pin_radius", "eccentricity", "sun_pitch_radius", "centre_distance")
    return RvGeometry(
        cycloid_teeth=int(p["cycloid_teeth"]),
        pins=int(p["pins"]),
        reduction_ratio=p["reduction_ratio"],
        expansion=p.get("thermal_expansion_per_K", RvGeometry().expansion),
        **{name: p[f"{name}_mm"] * MM for name in lengths if f"{name}_mm" in p},
    )


def undercut(geometry: RvGeometry) -> list[Fault]:
    """The fault of an eccentricity that undercuts the profile, if there is one."""
    if geometry.k1 < 1.0:
        return []
    text = f"e z_p/r_p must be below 1 (no undercut), got {geometry.k1:.4g}; lower the eccentricity"
    return [Fault("parameters.eccentricity_mm", text)]


def _stage(p: Mapping[str, float]) -> InvoluteStage:
    return InvoluteStage(
        pressure_angle=radians(p["pressure_angle_deg"]),
        runout=p["gear_runout_um"] * UM,
        base_pitch=p["base_pitch_deviation_um"] * UM,
        helix=p["helix_deviation_um"] * UM,
        parallelism_x=p["axis_parallelism_x_um"] * UM,
        parallelism_y=p["axis_parallelism_y_um"] * UM,
        centre_distance=p["centre_distance_deviation_um"] * UM,
        thickness_upper=p["thickness_deviation_upper_um"] * UM,
        thickness_lower=p["thickness_deviation_lower_um"] * UM,
        cosine=bool(p["involute_cosine"]),
    )


def allocation(designs: Mapping[str, Array]) -> Allocation:
    """The allocation (SI) of designs given by variable name in the variable's unit, each (n,)."""
    return Allocation(
        half_width={error: designs[f"{error}_um"] * UM for error in ERRORS},
        crank_bearing=designs["crank_bearing_um"] * UM,
        involute_grade=designs["involute_grade"],
        stagger=designs["stagger_arcmin"] * ARCMIN,
        dr_rp=designs["dr_rp_mm"] * MM,
        dr_p=designs["dr_p_mm"] * MM,
    )


# Rows of a measurement table of a loaded unit, checked.


SPEED = "must be above 0 (omit the column for quasi-static measurements; the sense of turning is `direction`)"


@dataclass(frozen=True, slots=True)
class Rows:
    """Columns (n,) of a table in SI; `speed` and `direction` are None where the table has none.

    `angle` [rad] and `torque` [N m] are zero where the table has none, `speed` is in rad/s,
    `direction` is +1 or -1; `angled` is true where the table has angles.
    """

    angle: Array
    torque: Array
    speed: Array | None
    direction: Array | None
    angled: bool

    def __len__(self) -> int:
        return len(self.angle)

    @classmethod
    def of(cls, table: Mapping[str, NDArray[Any]]) -> Rows:
        """The rows of a table. Raises InputError with every fault of its numbers."""
        names = ("output_angle_deg", "torque_Nm", "output_speed_rpm", "direction")
        columns = {n: np.asarray(table[n], dtype=float) for n in names if n in table}
        raise_all(_faults(columns))
        count = len(next(iter(table.values()))) if table else 0
        speed = columns.get("output_speed_rpm")
        return cls(
            angle=np.radians(columns.get("output_angle_deg", np.zeros(count))),
            torque=columns.get("torque_Nm", np.zeros(count)),
            speed=None if speed is None else speed * (2.0 * np.pi / 60.0),
            direction=columns.get("direction"),
            angled="output_angle_deg" in columns,
        )


def _faults(columns: Mapping[str, Array]) -> list[Fault]:
    faults = []
    for name, column in columns.items():
        wrong = ~np.isfinite(column)
        text = "must be finite"
        if name == "output_speed_rpm":
            wrong, text = wrong | (column <= 0.0), SPEED
        if name == "direction":
            wrong, text = wrong | (np.abs(column) != 1.0), "must be 1 or -1"
        if wrong.any():
            row = int(np.argmax(wrong))
            faults.append(Fault(f"{name}, row {row + 1}", f"{text}, got {column[row]:g}"))
    return faults


def outside(table: Mapping[str, NDArray[Any]], momentary: float) -> Outside:
    """Torques [N m] beyond the momentary one, and speeds that are not positive."""
    rows: dict[str, tuple[NDArray[np.bool_], str]] = {}
    if "torque_Nm" in table:
        wrong = np.abs(np.asarray(table["torque_Nm"], dtype=float)) > momentary
        text = f"is beyond the momentary torque of the reducer, {momentary:g} N m"
        rows["torque_Nm"] = wrong, text
    if "output_speed_rpm" in table:
        wrong = np.asarray(table["output_speed_rpm"], dtype=float) <= 0.0
        rows["output_speed_rpm"] = wrong, SPEED
    return rows
