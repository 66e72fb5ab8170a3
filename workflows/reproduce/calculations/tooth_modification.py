"""Tooth modification as document B optimises it, on the corrected clearances, and on its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ....arrays import Array
from ....declarations import Parameter, Value, number
from ....errors import raise_all, refuse
from ....models.rv_reducer import clearance_targets as targets
from ....models.rv_reducer.clearance_targets import Target
from ....models.rv_reducer.geometry import RvGeometry
from ....models.rv_reducer.modification import clearance, modification_backlash, raw_clearance, zero_backlash_pair
from ....models.rv_reducer.printed_clearance import printed_clearance
from ....models.rv_reducer.tooth_fit import CLEARANCES, LARGEST, Fit, fit
from ....problems.settings import Settings
from ....problems.tooth_modification import ToothModification
from ....problems.tooth_modification import declared as loaded
from ....units import ARCMIN, MM, UM
from ..calculation import Calculation, Chart, Computed, ComputedTable
from .results import assumed, output, parameter, quantities, tabulated

FILMS = ((1.0, 30.0, 45.0), (1.9, 20.0, 60.0), (3.5, 20.0, 90.0), (6.1, 0.0, 180.0))
"""Films [um] and their bands [deg] that bring the raw clearance to the printed dr_p = -0.070 mm."""
TABLE_STEP_DEG = 10.0
TARGETS = ("film", "near_conjugate", "table")


def _of_target(name: str, default: Value, meaning: str, high: float) -> Parameter:
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
        *loaded.PARAMETERS,
        parameter("printed_dr_rp_mm", -0.040, "printed optimum, equidistance", "document B", -1.0, 0.0),
        parameter("printed_dr_p_mm", -0.070, "printed optimum, shift", "document B", -1.0, 0.0),
        parameter("radial_gap_mm", 0.03, "gap at tip and root, dr_rp - dr_p", "document B", 0.0, LARGEST / MM),
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
        _of_target("film_um", 1.0, "lubrication film, over the band", 1000.0),
        _of_target("band_deg", (30.0, 45.0), "band of phi in which the film counts", 180.0),
        _of_target("rotation_arcmin", 0.05, "near_conjugate: turn of the rotation-modified profile", 60.0),
        _of_target("working_deg", (20.0, 120.0), "near_conjugate: flank between the reliefs at root and tip", 180.0),
        _of_target(
            "table_um",
            (30.0, 5.0, *(0.0,) * 11, 1.0, 3.0, 7.0, 13.0, 20.0, 30.0),
            "table: clearance at phi = 0, 10, .. 180 deg",
            1000.0,
        ),
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        case = _case(self.completed(values))
        fitted = _fitted(case, case.target(str(case.values["target"])), case.gap)
        numbers = _optimum(case, fitted) | _printed(case)
        return Computed(quantities(numbers), (_targets(case), _as_printed(case), _profile(case, fitted)))


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
        return targets.angles(int(number(self.values["intervals"])))

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
            return targets.film(self.phi, self.number("film_um") * UM, self.band("band_deg"))
        if kind == "near_conjugate":
            turn, gap = self.number("rotation_arcmin") * ARCMIN, self.number("radial_gap_mm") * MM
            working = self.band("working_deg")
            return targets.near_conjugate(self.geometry, self.phi, turn, gap, working)
        wanted = self.values["table_um"]
        values = np.array(wanted if isinstance(wanted, tuple) else [], dtype=float) * UM
        return targets.table(self.phi, np.radians(TABLE_STEP_DEG * np.arange(len(values))), values)

    def outputs(self, pairs: Array) -> dict[str, Array]:
        """Outputs of the loaded contact of pairs (n, 2) [m]."""
        return self.problem.outputs_of(pairs / MM)


def _case(parameters: Mapping[str, Value]) -> Case:
    """Raises InputError where the geometry is undercut."""
    names = {parameter.name for parameter in loaded.PARAMETERS}
    geometry = {name: value for name, value in parameters.items() if name in names}
    problem = ToothModification(Settings(parameters=geometry))
    raise_all(problem.faults())
    return Case(parameters, problem)


def _fitted(case: Case, target: Target, gap: float | None, kind: str = "") -> Fit:
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


def _printed(case: Case) -> dict[str, float]:
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
        yield f"film {film:g} um over {low:g} .. {high:g} deg", targets.film(case.phi, film * UM, band)
    yield "no clearance anywhere", targets.film(case.phi, 0.0, (0.0, np.pi))
    yield "near_conjugate", case.target("near_conjugate")
    yield "table", case.target("table")
    yield "as asked", case.target(str(case.values["target"]))


def _targets(case: Case) -> ComputedTable:
    """The optimum of every target on either clearance, with the radial gap fixed and free."""
    gap = case.number("radial_gap_mm") * MM
    rows = [
        (text, kind, radial_gap, _fitted(case, target, gap if radial_gap == "fixed" else None, kind))
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
    return tabulated("targets", meaning, columns)


def _as_printed(case: Case) -> ComputedTable:
    """Clearances at the printed optimum, printed and corrected."""
    columns = {"phi_deg": np.degrees(case.phi)}
    columns |= {f"{name}_um": curve / UM for name, curve in _curves(case).items()}
    meaning = (
        "Clearance at the printed optimum: as printed (S at phi - phi_0, and at phi), which breaks "
        "g5 where it is negative, and the two corrected forms"
    )
    chart = Chart("lines", "phi_deg", tuple(columns)[1:])
    return tabulated("printed_clearance", meaning, columns, chart)


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
    return tabulated("profile", "Clearance of the optimum and its target", columns, chart)
