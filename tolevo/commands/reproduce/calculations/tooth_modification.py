"""Tooth modification as document B optimises it, on the corrected clearances, and on its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from ....errors import Fault, raise_all, refuse
from ....models.rv_reducer import cycloid, declared
from ....models.rv_reducer.backlash import BacklashModel
from ....models.rv_reducer.cycloid import (
    CLEARANCES,
    LINEAR_ERRORS,
    MAX_MODIFICATION_M,
    Fit,
    Target,
    coefficients,
    fit,
    printed_clearance,
)
from ....models.rv_reducer.declared import PRINTED
from ....models.rv_reducer.geometry import (
    RvGeometry,
    clearance,
    modification_backlash,
    raw_clearance,
    zero_backlash_pair,
)
from ....models.rv_reducer.tighter_planet import (
    ERRORS,
    Bounds,
    Stage,
    ZoneOptimum,
    equal_shares,
    least_clipped_rotation,
    least_rotation,
)
from ....problems import tooth_modification
from ....problems.settings import Settings
from ....problems.tooth_modification import ToothModification
from ....section import READING, Array, Parameter, Value, number
from ....units import ARCMIN, MM, UM
from ..recipes import Calculation, Computed
from ..records import Chart, ComputedTable
from .reducer import assumed, make_table, output, parameter, quantities

FILMS = ((1.0, 30.0, 45.0), (1.9, 20.0, 60.0), (3.5, 20.0, 90.0), (6.1, 0.0, 180.0))
"""Films [um] and their bands [deg] that bring the raw clearance to the printed dr_p = -0.070 mm."""
TABLE_STEP_DEG = 10.0
TARGETS = ("film", "near_conjugate", "table")


def _target_parameter(name: str, default: Value, meaning: str, high: float) -> Parameter:
    return assumed(name, default, meaning, "assumed: the document prints neither target nor band", 0.0, high)


CURVES = {
    "printed": "as printed",
    "printed_own_phase": "as printed, with S at phi",
    "raw": "D_raw",
    "after_contact": "D",
}
OUTPUTS = (
    output("dr_rp_mm", "equidistance modification nearest to the target"),
    output("dr_p_mm", "shift modification nearest to the target"),
    output("backlash_arcmin", "its backlash by 2 (dr_rp - dr_p sqrt(1-k1^2))/(e z_c)"),
    output("exact_backlash_arcmin", "its backlash at the output by exact contact"),
    output("peak_mesh_force_N", "its largest force on a pin under the torque"),
    output("deviation_um", "its sum of deviations from the target"),
    output("bound_um", "proven lower bound of the sum"),
    output("gap_um", "what the proof leaves open"),
    output("zero_backlash_dr_rp_mm", "equidistance without backlash at the radial gap"),
    output("zero_backlash_dr_p_mm", "shift without backlash at the radial gap"),
    output("printed_optimum_backlash_arcmin", "backlash of the printed optimum by the formula"),
    output("printed_optimum_exact_backlash_arcmin", "the same at the output by exact contact"),
    output("printed_optimum_peak_mesh_force_N", "its largest force on a pin under the torque"),
    *(
        declaration
        for name, text in CURVES.items()
        for declaration in (
            output(f"least_{name}_clearance_mm", f"least clearance {text} at the printed optimum"),
            output(f"least_{name}_clearance_at_deg", "profile angle where it is least"),
        )
    ),
)


class ToothModificationTargets(Calculation):
    """The modification nearest to a target clearance under g1 to g5: a linear programme, proven."""

    name = "tooth_modification"
    about = "Modifications nearest to target clearances under g1 to g5, and the printed clearance."
    reference = "document B, tooth profile modification"
    sampled = False
    outputs = OUTPUTS
    parameters = (
        *tooth_modification.PARAMETERS,
        parameter("printed_dr_rp_mm", -0.040, "printed optimum, equidistance", "document B", -1.0, 0.0),
        parameter("printed_dr_p_mm", -0.070, "printed optimum, shift", "document B", -1.0, 0.0),
        parameter(
            "radial_gap_mm", 0.03, "gap at tip and root, dr_rp - dr_p", "document B", 0.0, MAX_MODIFICATION_M / MM
        ),
        parameter("radial_gap", "fixed", "whether the radial gap is kept", "document B", choices=("fixed", "free")),
        assumed(
            "clearance",
            "raw",
            "raw: in the nominal position; after_contact: once the disc has turned to first contact",
            "the printed form is garbled",
            choices=tuple(CLEARANCES),
        ),
        assumed("intervals", 360, "n: intervals of phi in [0, pi]", low=2, high=20_000),
        assumed("target", "film", "what the clearance should be", "assumed: not printed", choices=TARGETS),
        _target_parameter("film_um", 1.0, "lubrication film, over the band", 1000.0),
        _target_parameter("band_deg", (30.0, 45.0), "band of phi in which the film counts", 180.0),
        _target_parameter("rotation_arcmin", 0.05, "near_conjugate: turn of the rotation-modified profile", 60.0),
        _target_parameter(
            "working_deg", (20.0, 120.0), "near_conjugate: flank between the reliefs at root and tip", 180.0
        ),
        _target_parameter(
            "table_um",
            (30.0, 5.0, *(0.0,) * 11, 1.0, 3.0, 7.0, 13.0, 20.0, 30.0),
            "table: clearance at phi = 0, 10, .. 180 deg",
            1000.0,
        ),
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        case = _case(self.completed(values))
        fitted = _fit_modification(case, case.target(str(case.values["target"])), case.gap)
        numbers = _optimum(case, fitted) | _printed_optimum(case)
        return Computed(quantities(numbers), (_targets(case), _printed_clearances(case), _profile(case, fitted)))


@dataclass(frozen=True)
class Case:
    """A case: completed values, the geometry, and the problem of the loaded contact."""

    values: Mapping[str, Value]
    problem: ToothModification

    @property
    def geometry(self) -> RvGeometry:
        """The nominal geometry."""
        return self.problem.geometry

    @property
    def phi(self) -> Array:
        """Profile angles [rad]."""
        return cycloid.angles(int(number(self.values["intervals"])))

    @property
    def gap(self) -> float | None:
        """Radial gap [m], None where it is free."""
        return None if self.values["radial_gap"] == "free" else self.number("radial_gap_mm") * MM

    @property
    def printed(self) -> tuple[Array, Array]:
        """The printed optimum [m]."""
        dr_rp, dr_p = (np.array(self.number(f"printed_{name}_mm") * MM) for name in ("dr_rp", "dr_p"))
        return dr_rp, dr_p

    def number(self, name: str) -> float:
        """A parameter."""
        return number(self.values[name])

    def band(self, name: str) -> tuple[float, float]:
        """A band [rad]. Raises InputError where it is empty."""
        value = self.values[name]
        low, high = value if isinstance(value, tuple) else (0.0, number(value))
        if not low < high:
            raise refuse(f"parameters.{name}", f"the first angle must be below the second, got [{low:g}, {high:g}]")
        return float(np.radians(low)), float(np.radians(high))

    def target(self, kind: str) -> Target:
        """One of `TARGETS` by the parameters."""
        if kind == "film":
            return cycloid.film(self.phi, self.number("film_um") * UM, self.band("band_deg"))
        if kind == "near_conjugate":
            turn, gap = self.number("rotation_arcmin") * ARCMIN, self.number("radial_gap_mm") * MM
            working = self.band("working_deg")
            return cycloid.near_conjugate(self.geometry, self.phi, turn, gap, working)
        wanted = self.values["table_um"]
        values = np.array(wanted if isinstance(wanted, tuple) else [], dtype=float) * UM
        return cycloid.table(self.phi, np.radians(TABLE_STEP_DEG * np.arange(len(values))), values)

    def outputs(self, pairs: Array) -> dict[str, Array]:
        """Outputs of the loaded contact of pairs (n, 2) [m]."""
        return self.problem.outputs_of(pairs / MM)


def _case(parameters: Mapping[str, Value]) -> Case:
    """Raises InputError where the geometry is undercut."""
    names = {parameter.name for parameter in tooth_modification.PARAMETERS}
    geometry = {name: value for name, value in parameters.items() if name in names}
    problem = ToothModification(Settings(parameters=geometry))
    raise_all(problem.faults())
    return Case(parameters, problem)


def _fit_modification(case: Case, target: Target, gap: float | None, kind: str = "") -> Fit:
    """Raises InputError where no angle counts: the band lies between two of them."""
    if not np.any(target.weight):
        raise refuse("parameters.band_deg", "no angle lies in it: widen it, or raise intervals")
    return fit(case.geometry, target, gap, kind or str(case.values["clearance"]))


def _backlash(case: Case, dr_rp: Array | float, dr_p: Array | float) -> Array:
    """By document B's formula [arcmin]."""
    pair = np.asarray(dr_rp), np.asarray(dr_p)
    return np.asarray(modification_backlash(case.geometry, *pair) / ARCMIN)


def _optimum(case: Case, fitted: Fit) -> dict[str, float]:
    outputs = case.outputs(np.array([[fitted.dr_rp, fitted.dr_p]]))
    pair = zero_backlash_pair(case.geometry, case.number("radial_gap_mm") * MM)
    return {
        "dr_rp_mm": fitted.dr_rp / MM,
        "dr_p_mm": fitted.dr_p / MM,
        "backlash_arcmin": float(_backlash(case, fitted.dr_rp, fitted.dr_p)),
        "exact_backlash_arcmin": float(outputs["backlash_arcmin"][0]),
        "peak_mesh_force_N": float(outputs["peak_mesh_force_N"][0]),
        "deviation_um": fitted.deviation / UM,
        "bound_um": fitted.bound / UM,
        "gap_um": fitted.gap / UM,
        "zero_backlash_dr_rp_mm": pair[0] / MM,
        "zero_backlash_dr_p_mm": pair[1] / MM,
    }


def _printed_optimum(case: Case) -> dict[str, float]:
    """What becomes of the printed optimum by the printed clearance and by the corrected ones."""
    outputs = case.outputs(np.array([case.printed]))
    numbers = {
        "printed_optimum_backlash_arcmin": float(_backlash(case, *case.printed)),
        "printed_optimum_exact_backlash_arcmin": float(outputs["backlash_arcmin"][0]),
        "printed_optimum_peak_mesh_force_N": float(outputs["peak_mesh_force_N"][0]),
    }
    for name, curve in _curves(case).items():
        at = int(np.argmin(curve))
        numbers[f"least_{name}_clearance_mm"] = float(curve[at]) / MM
        numbers[f"least_{name}_clearance_at_deg"] = float(np.degrees(case.phi[at]))
    return numbers


def _curves(case: Case) -> dict[str, Array]:
    """Clearances [m] at the printed optimum, in the order of `CURVES`."""
    at = case.geometry, *case.printed, case.phi
    curves = (printed_clearance(*at), printed_clearance(*at, own_phase=True), raw_clearance(*at), clearance(*at))
    return dict(zip(CURVES, curves, strict=True))


def _cases(case: Case) -> Iterator[tuple[str, Target]]:
    for film, low, high in FILMS:
        band = float(np.radians(low)), float(np.radians(high))
        yield f"film {film:g} um over {low:g} .. {high:g} deg", cycloid.film(case.phi, film * UM, band)
    yield "no clearance anywhere", cycloid.film(case.phi, 0.0, (0.0, np.pi))
    yield "near_conjugate", case.target("near_conjugate")
    yield "table", case.target("table")
    yield "as asked", case.target(str(case.values["target"]))


def _targets(case: Case) -> ComputedTable:
    """The optimum of every target on either clearance, with the radial gap fixed and free."""
    gap = case.number("radial_gap_mm") * MM
    rows = [
        (text, kind, radial_gap, _fit_modification(case, target, gap if radial_gap == "fixed" else None, kind))
        for radial_gap in ("fixed", "free")
        for kind in CLEARANCES
        for text, target in _cases(case)
    ]
    fits = [row[3] for row in rows]
    pairs = np.array([[fitted.dr_rp, fitted.dr_p] for fitted in fits])
    outputs = case.outputs(pairs)
    columns = {
        "target": [row[0] for row in rows],
        "clearance": [row[1] for row in rows],
        "radial_gap": [row[2] for row in rows],
        "dr_rp_mm": pairs[:, 0] / MM,
        "dr_p_mm": pairs[:, 1] / MM,
        "deviation_um": [fitted.deviation / UM for fitted in fits],
        "bound_um": [fitted.bound / UM for fitted in fits],
        "backlash_arcmin": _backlash(case, pairs[:, 0], pairs[:, 1]),
        "exact_backlash_arcmin": outputs["backlash_arcmin"],
        "peak_mesh_force_N": outputs["peak_mesh_force_N"],
    }
    meaning = (
        "The modification nearest to each target, with its proven bound. The printed optimum "
        "depends on a target and a band that are not printed"
    )
    return make_table("targets", meaning, columns)


def _printed_clearances(case: Case) -> ComputedTable:
    """Clearances at the printed optimum, printed and corrected."""
    columns = {"phi_deg": np.degrees(case.phi)}
    columns |= {f"{name}_um": curve / UM for name, curve in _curves(case).items()}
    meaning = (
        "Clearance at the printed optimum: as printed (S at phi - phi_0, and at phi), which breaks "
        "g5 where it is negative, and the two corrected forms"
    )
    chart = Chart("lines", "phi_deg", tuple(columns)[1:])
    return make_table("printed_clearance", meaning, columns, chart)


def _profile(case: Case, fitted: Fit) -> ComputedTable:
    """The clearance of the optimum and its target."""
    target = case.target(str(case.values["target"]))
    pair = np.array(fitted.dr_rp), np.array(fitted.dr_p)
    curve = CLEARANCES[str(case.values["clearance"])](case.geometry, *pair, target.phi)
    columns = {
        "phi_deg": np.degrees(target.phi),
        "clearance_um": curve / UM,
        "target_um": target.clearance / UM,
        "weight": target.weight,
    }
    chart = Chart("lines", "phi_deg", ("clearance_um", "target_um"))
    return make_table("profile", "Clearance of the optimum and its target", columns, chart)


# Optimum of the nine cycloid errors within bounds, and the document's zones for comparison.


INITIAL_UM: Mapping[str, tuple[float, float]] = {
    "pin_circle_radius": (-5.0, 5.0),
    "pin_position": (-5.0, 5.0),
    "pin_hole_radius": (0.0, 5.0),
    "pin_radius": (-5.0, 0.0),
    "pitch": (-8.0, 8.0),
    "runout": (-2.0, 2.0),
    "eccentricity": (-5.0, 5.0),
    "equidistance": (-3.0, 3.0),
    "shift": (-3.0, 3.0),
}
"""Initial bounds: the document has them and prints none. Symmetric, but for what it says of holes
(positive for assembly) and pins (negative)."""
PRINTED_UM: Mapping[str, tuple[float, float]] = {
    "pin_circle_radius": (-4.0, 2.0),
    "pin_position": (-3.0, 1.0),
    "pin_hole_radius": (1.0, 4.0),
    "pin_radius": (-2.0, 0.0),
    "pitch": (-7.0, 1.0),
    "runout": (-1.0, 1.0),
    "equidistance": (-2.0, 0.0),
    "shift": (0.0, 2.0),
}
"""The document's table of practical zones; it has none for the eccentricity."""
_SIZES = (
    "pin_circle_radius_mm",
    "pin_radius_mm",
    "eccentricity_mm",
    "cycloid_teeth",
    "pins",
    "eccentricity_linear",
    "eccentricity_quadratic_per_mm",
)


def _zone(error: str) -> Parameter:
    text = f"initial bounds of the {error.replace('_', ' ')} error"
    most = declared.MAX_ECCENTRICITY_UM if error == "eccentricity" else 1000.0
    return assumed(f"{error}_zone_um", INITIAL_UM[error], text, "assumed: the document prints none", -most, most)


ZONE_OUTPUTS = (
    output("phi_2_arcmin", "least phi_2 within the bounds, modification included; below 0: interference"),
    output("bound_arcmin", "its proven lower bound"),
    output("gap_arcmin", "what the proof leaves open"),
    output("without_modification_arcmin", "the errors' part of it"),
    output("clipped_backlash_arcmin", "least max(0, phi_2) within the bounds"),
    output("clipped_bound_arcmin", "its proven lower bound"),
    *(output(f"{error}_um", "error at the least phi_2") for error in ERRORS),
    *(output(f"clipped_{error}_um", "error at the least max(0, phi_2)") for error in ERRORS),
    output("printed_favourable_arcmin", "least phi_2 within the printed zones"),
    output("printed_middle_arcmin", "phi_2 at their mid-limits"),
    output("printed_adverse_arcmin", "largest phi_2 within them"),
    output("printed_zones", "zones that are printed"),
    output("printed_zones_towards_optimum", "of these, with their middle towards the optimum"),
    output("printed_largest_share_arcmin", "the most that phi_2 spans over one printed zone"),
    output("printed_smallest_share_arcmin", "the least that it spans over one"),
)


class ToleranceZones(Calculation):
    """Errors of the cycloid stage that leave least backlash within initial bounds, proven."""

    name = "tolerance_zones"
    about = "Errors of the cycloid stage of least backlash within bounds, and the printed zones."
    reference = "document B, tolerance zone optimization"
    sampled = False
    outputs = ZONE_OUTPUTS
    parameters = (
        *(parameter for parameter in declared.PARAMETERS if parameter.name in _SIZES),
        parameter("dr_rp_mm", -0.040, "equidistance modification", "document B", -1.0, 1.0),
        parameter("dr_p_mm", -0.070, "shift modification", "document B", -1.0, 1.0),
        *(_zone(error) for error in ERRORS),
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        model = declared.backlash_model({READING: PRINTED} | parameters, None, {})
        stage, bounds = _stage(model, parameters), _bounds(parameters)
        optimum, clipped = least_rotation(stage, bounds), least_clipped_rotation(stage, bounds)
        numbers = _zone_optimum(stage, optimum, clipped) | _compare_printed_zones(stage, optimum)
        return Computed(quantities(numbers), (_table(stage, bounds, optimum, clipped),))


def _stage(model: BacklashModel, parameters: Mapping[str, Value]) -> Stage:
    pair = [np.array(number(parameters[name]) * MM) for name in ("dr_rp_mm", "dr_p_mm")]
    offset = float(modification_backlash(model.geometry, *pair))
    return Stage(model.geometry, model.eccentricity, offset)


def _bounds(parameters: Mapping[str, Value]) -> Bounds:
    """Raises InputError where bounds are reversed."""
    bounds, faults = {}, []
    for error in ERRORS:
        value = parameters[f"{error}_zone_um"]
        low, high = value if isinstance(value, tuple) else (number(value),) * 2
        if not low <= high:
            text = f"the lower bound must not be above the upper one, got [{low:g}, {high:g}]"
            faults.append(Fault(f"parameters.{error}_zone_um", text))
        bounds[error] = (low * UM, high * UM)
    raise_all(faults)
    return bounds


def _zone_optimum(stage: Stage, optimum: ZoneOptimum, clipped: ZoneOptimum) -> dict[str, float]:
    numbers = {
        "phi_2_arcmin": optimum.backlash / ARCMIN,
        "bound_arcmin": optimum.bound / ARCMIN,
        "gap_arcmin": (optimum.backlash - optimum.bound) / ARCMIN,
        "without_modification_arcmin": (optimum.backlash - stage.offset) / ARCMIN,
        "clipped_backlash_arcmin": max(0.0, clipped.backlash) / ARCMIN,
        "clipped_bound_arcmin": max(0.0, clipped.bound) / ARCMIN,
    }
    for error in optimum.errors:
        numbers[f"{error}_um"] = optimum.errors[error] / UM
        numbers[f"clipped_{error}_um"] = clipped.errors[error] / UM
    return numbers


def _compare_printed_zones(stage: Stage, optimum: ZoneOptimum) -> dict[str, float]:
    """phi_2 within the printed zones, and how far they follow from optimum and sensitivities."""
    printed = {error: (low * UM, high * UM) for error, (low, high) in PRINTED_UM.items()}
    middle = {error: 0.5 * (low + high) for error, (low, high) in printed.items()}
    worst = {error: max(ends, key=partial(stage.contribution, error)) for error, ends in printed.items()}
    spans = _shares(stage)
    return {
        "printed_favourable_arcmin": least_rotation(stage, printed).backlash / ARCMIN,
        "printed_middle_arcmin": stage.backlash(middle) / ARCMIN,
        "printed_adverse_arcmin": stage.backlash(worst) / ARCMIN,
        "printed_zones": float(len(printed)),
        "printed_zones_towards_optimum": float(np.sum(_position_to_optimum(optimum) == "yes")),
        "printed_largest_share_arcmin": float(spans.max()),
        "printed_smallest_share_arcmin": float(spans.min()),
    }


def _shares(stage: Stage) -> np.ndarray:
    """Width of phi_2 [arcmin] over each printed zone, of the linear errors in their order."""
    width = [PRINTED_UM[error][1] - PRINTED_UM[error][0] for error in LINEAR_ERRORS]
    gain = [abs(coefficients(stage.geometry)[error]) for error in LINEAR_ERRORS]
    return np.array(width) * gain * UM / stage.geometry.lever / ARCMIN


def _position_to_optimum(optimum: ZoneOptimum) -> np.ndarray:
    """Whether the middle of each printed zone lies towards the optimum: yes, no, centred."""
    middle = np.array([sum(PRINTED_UM[error]) for error in LINEAR_ERRORS])
    side = middle * np.array([optimum.errors[error] for error in LINEAR_ERRORS])
    at_end = np.array([0.0 in PRINTED_UM[e] and optimum.errors[e] == 0.0 for e in LINEAR_ERRORS])
    return np.asarray(np.where(middle == 0.0, "centred", np.where((side > 0.0) | at_end, "yes", "no")))


def _table(stage: Stage, bounds: Bounds, optimum: ZoneOptimum, clipped: ZoneOptimum) -> ComputedTable:
    """One row per error; empty (NaN) where the document prints nothing."""
    equal = equal_shares(stage, float(_shares(stage).sum()) * ARCMIN)
    ends = np.array([PRINTED_UM.get(error, (np.nan, np.nan)) for error in ERRORS])
    gains = [coefficients(stage.geometry).get(error, np.nan) for error in ERRORS]
    columns = {
        "error": list(ERRORS),
        "coefficient": gains,
        "initial_low_um": [bounds[error][0] / UM for error in ERRORS],
        "initial_high_um": [bounds[error][1] / UM for error in ERRORS],
        "optimum_um": [optimum.errors[error] / UM for error in ERRORS],
        "clipped_optimum_um": [clipped.errors[error] / UM for error in ERRORS],
        "printed_low_um": ends[:, 0],
        "printed_high_um": ends[:, 1],
        "towards_optimum": [*_position_to_optimum(optimum), "not printed"],
        "printed_share_arcmin": [*_shares(stage), np.nan],
        "width_at_equal_share_um": [*(equal[error] / UM for error in LINEAR_ERRORS), np.nan],
    }
    meaning = (
        "Errors of least phi_2 within the initial bounds (assumed), without and with phi_2 >= 0, "
        "and the printed practical zones: whether their middle lies towards the optimum, what "
        "phi_2 spans over each, and the width at which all would span alike"
    )
    return make_table("errors", meaning, columns)
