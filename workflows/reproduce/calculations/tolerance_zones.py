"""Optimum of the nine cycloid errors within bounds, and the document's zones for comparison."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....declarations import READING, Parameter, Value, number
from ....errors import Fault, raise_all
from ....models.rv_reducer import declared
from ....models.rv_reducer.backlash import BacklashModel
from ....models.rv_reducer.cycloid import LINEAR_ERRORS, coefficients
from ....models.rv_reducer.modification import modification_backlash
from ....models.rv_reducer.reading import PRINTED
from ....models.rv_reducer.zone_optimum import ERRORS, Bounds, Stage, ZoneOptimum, equal_shares, least, least_clipped
from ....units import ARCMIN, MM, UM
from ..calculation import Calculation, Computed, ComputedTable
from .results import assumed, output, parameter, quantities, tabulated

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


OUTPUTS = (
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
    outputs = OUTPUTS
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
        optimum, clipped = least(stage, bounds), least_clipped(stage, bounds)
        numbers = _optimum(stage, optimum, clipped) | _printed(stage, optimum)
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


def _optimum(stage: Stage, optimum: ZoneOptimum, clipped: ZoneOptimum) -> dict[str, float]:
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


def _printed(stage: Stage, optimum: ZoneOptimum) -> dict[str, float]:
    """phi_2 within the printed zones, and how far they follow from optimum and sensitivities."""
    printed = {error: (low * UM, high * UM) for error, (low, high) in PRINTED_UM.items()}
    middle = {error: 0.5 * (low + high) for error, (low, high) in printed.items()}
    worst = {error: _adverse(stage, error, ends) for error, ends in printed.items()}
    spans = _shares(stage)
    return {
        "printed_favourable_arcmin": least(stage, printed).backlash / ARCMIN,
        "printed_middle_arcmin": stage.backlash(middle) / ARCMIN,
        "printed_adverse_arcmin": stage.backlash(worst) / ARCMIN,
        "printed_zones": float(len(printed)),
        "printed_zones_towards_optimum": float(np.sum(_towards(optimum) == "yes")),
        "printed_largest_share_arcmin": float(spans.max()),
        "printed_smallest_share_arcmin": float(spans.min()),
    }


def _adverse(stage: Stage, error: str, ends: tuple[float, float]) -> float:
    """The end [m] that adds most."""
    return max(ends, key=lambda end: stage.contribution(error, end))


def _shares(stage: Stage) -> np.ndarray:
    """Width of phi_2 [arcmin] over each printed zone, of the linear errors in their order."""
    width = [PRINTED_UM[error][1] - PRINTED_UM[error][0] for error in LINEAR_ERRORS]
    gain = [abs(coefficients(stage.geometry)[error]) for error in LINEAR_ERRORS]
    return np.array(width) * gain * UM / stage.geometry.lever / ARCMIN


def _towards(optimum: ZoneOptimum) -> np.ndarray:
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
        "towards_optimum": [*_towards(optimum), "not printed"],
        "printed_share_arcmin": [*_shares(stage), np.nan],
        "width_at_equal_share_um": [*(equal[error] / UM for error in LINEAR_ERRORS), np.nan],
    }
    meaning = (
        "Errors of least phi_2 within the initial bounds (assumed), without and with phi_2 >= 0, "
        "and the printed practical zones: whether their middle lies towards the optimum, what "
        "phi_2 spans over each, and the width at which all would span alike"
    )
    return tabulated("errors", meaning, columns)
