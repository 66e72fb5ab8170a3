"""Calculations of document B: the backlash of the reducer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from math import inf
from types import MappingProxyType
from typing import Any

import numpy as np

from ....errors import refuse
from ....models.inputs import DISTRIBUTIONS, Distribution
from ....models.propagation import ClippedSum, Convolution, Propagated
from ....models.propagation.moments import Stated, share
from ....models.propagation.sums import total_cumulants
from ....models.rv_reducer import declared
from ....models.rv_reducer import geometry as stagger
from ....models.rv_reducer.backlash import BacklashModel
from ....models.rv_reducer.batch import Batch, batch
from ....models.rv_reducer.contact.contact import LoadedContact, backlash
from ....models.rv_reducer.contact.geometry import ContactGeometry, PartErrors
from ....models.rv_reducer.declared import PRINTED
from ....models.rv_reducer.geometry import RvGeometry
from ....records import Axis
from ....section import READING, Array, Kind, Output, Parameter, Value, Variable, number
from ....units import ARCMIN, MM, MRAD, UM, split_unit
from ..recipes import Calculation, Computed, Quantity
from ..records import Chart, ComputedTable


def parameter(
    name: str, default: Value, meaning: str, source: str, low: float = -inf, high: float = inf, **more: Any
) -> Parameter:
    """An input of a calculation; its unit is what the name ends with."""
    return Parameter(name, default, split_unit(name)[1], meaning, source, low=low, high=high, **more)


def assumed(
    name: str, default: Value, meaning: str, source: str = "assumed", low: float = -inf, high: float = inf, **more: Any
) -> Parameter:
    """An input whose default no document prints."""
    return parameter(name, default, meaning, source, low, high, assumed=True, **more)


def output(name: str, meaning: str) -> Output:
    """A quantity that a calculation declares; its unit is what the name ends with."""
    return Output(name, split_unit(name)[1], meaning)


def quantities(numbers: Mapping[str, float | Stated]) -> dict[str, Quantity]:
    """Numbers by name, with the unit that the name ends with and their standard error, if any."""
    stated = {
        name: number if isinstance(number, Stated) else Stated(float(number), 0.0) for name, number in numbers.items()
    }
    return {
        name: Quantity(estimate.value, split_unit(name)[1] or "1", estimate.error) for name, estimate in stated.items()
    }


def make_table(name: str, meaning: str, columns: Mapping[str, Any], chart: Chart | None = None) -> ComputedTable:
    """A table of columns (n,) by name; the unit is what the name ends with."""
    axes = tuple(Axis(column, split_unit(column)[1]) for column in columns)
    return ComputedTable(name, meaning, axes, tuple(map(np.asarray, columns.values())), chart)


# The inputs of calculations on the backlash of a reducer, and the sum that they form.


PLAIN = ("uniform", "triangular", "trapezoid", "normal", "truncated_normal", "rayleigh")
"""Distributions whose parameters all have defaults."""
COMMON = "distribution"
SAME_AS_OTHERS = "as the others"
RANDOM = tuple(v for v in declared.VARIABLES if v.random)


def _tolerance_parameter(variable: Variable) -> Parameter:
    kind = "" if variable.kind is Kind.NOMINAL else f" ({variable.kind.value.split(' of ')[0]})"
    return Parameter(
        variable.name,
        float(variable.document or 0.0),
        variable.unit,
        variable.meaning + kind,
        variable.assumed or "document B",
        bool(variable.assumed),
        variable.valid_low,
        variable.valid_high,
    )


def _law_parameter(variable: Variable) -> Parameter:
    name = f"{stem(variable.name)}_distribution"
    return assumed(
        name, SAME_AS_OTHERS, f"distribution over units of {variable.meaning}", choices=(SAME_AS_OTHERS, *PLAIN)
    )


def stem(name: str) -> str:
    """The name of an error, of the variable that states its tolerance."""
    return name.removesuffix("_um")


PARAMETERS: tuple[Parameter, ...] = (
    *(
        replace(parameter, default=PRINTED) if parameter.name == READING else parameter
        for parameter in declared.PARAMETERS
    ),
    *(_tolerance_parameter(variable) for variable in declared.VARIABLES),
    assumed(
        COMMON,
        "uniform",
        "distribution of every error over units, where it has none of its own",
        "assumed: document B names none",
        choices=PLAIN,
    ),
    assumed(
        "cp",
        1.0,
        "process capability of the distributions that have one (normal, truncated normal, Rayleigh)",
        low=0.0,
        open_low=True,
    ),
    *(_law_parameter(variable) for variable in RANDOM),
)


def model_of(values: Mapping[str, Value]) -> BacklashModel:
    """The model of completed values. Raises InputError where the teeth would be undercut."""
    laws = {stem(variable.name): _law(values, stem(variable.name)) for variable in RANDOM}
    model = declared.backlash_model(values, None, laws)
    if not model.geometry.k1 < 1.0:
        text = f"e z_p/r_p must be below 1 (no undercut), got {model.geometry.k1:.4g}; lower it"
        raise refuse("parameters.eccentricity_mm", text)
    return model


def total_of(model: BacklashModel, values: Mapping[str, Value], **swept: Any) -> ClippedSum:
    """The sum over units; `swept` replaces designs by name with arrays (n,), in their unit."""
    count = max((np.size(column) for column in swept.values()), default=1)
    design = {v.name: swept.get(v.name, number(values[v.name])) for v in declared.VARIABLES}
    arrays = {name: np.broadcast_to(np.asarray(column, float), count) for name, column in design.items()}
    return model.total(declared.allocation(arrays))


def _law(values: Mapping[str, Value], name: str) -> Distribution:
    law = str(values[f"{name}_distribution"])
    kind = DISTRIBUTIONS[str(values[COMMON]) if law == SAME_AS_OTHERS else law]
    known = {field.name for field in fields(kind)}  # type: ignore[arg-type]
    stated = {"cp": number(values["cp"])} if "cp" in known else {}
    return kind(**stated)


# Backlash by stage: mean and spread of involute, cycloid and output stage (document B).


STAGES = ("involute", "cycloid", "output")


class BacklashStages(Calculation):
    """Mean and spread of the backlash of each stage over units, in closed form.

    As document B prints it (reading = "printed"). The cycloid stage as geometry has it: below zero
    is interference.
    """

    name = "backlash_stages"
    about = "Mean and spread of the backlash of each stage over units, in closed form."
    reference = "document B, backlash calculation"
    sampled = False
    parameters = (
        parameter(
            "crank_bearing_um",
            2.0,
            "clearance c of the crank-arm bearings, zone [0, c]",
            "document B: 2 in its table, 20 in its Monte Carlo",
            0.0,
            1e3,
        ),
        parameter("stagger_arcmin", 0.0, "turn of each disc, one ahead and one back", "document B", 0.0, 60.0),
    )
    outputs = tuple(
        declaration
        for stage in STAGES
        for declaration in (
            output(f"{stage}_mean_arcmin", f"mean of the {stage} stage"),
            output(f"{stage}_std_arcmin", f"standard deviation of the {stage} stage"),
            output(f"{stage}_variance_percent", f"share of the {stage} stage in the variance of the sum"),
        )
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        at = {variable.name: float(variable.document or 0.0) for variable in declared.VARIABLES}
        at |= {name: number(value) for name, value in parameters.items()}
        design = {name: np.array([value]) for name, value in at.items()}
        total = declared.backlash_model({READING: PRINTED}, None, {}).total(declared.allocation(design))
        involute, output = total.free
        parts = [total_cumulants(terms) for terms in ((involute,), total.clipped, (output,))]
        mean, variance = np.array([[float(part[k][0]) for part in parts] for k in (0, 1)])
        columns = {
            "mean_arcmin": mean / ARCMIN,
            "std_arcmin": np.sqrt(variance) / ARCMIN,
            "variance_percent": 100.0 * variance / variance.sum(),
        }
        numbers = {
            f"{stage}_{name}": float(column[row])
            for name, column in columns.items()
            for row, stage in enumerate(STAGES)
        }
        meaning = (
            f"Backlash by stage; crank-arm bearings 0..{parameters['crank_bearing_um']} um, "
            f"stagger {parameters['stagger_arcmin']} arcmin"
        )
        return Computed(quantities(numbers), (make_table("stages", meaning, {"stage": STAGES, **columns}),))


# Monte Carlo of the backlash of reducers, through all three stages.


COVERAGE = 0.9973
SPREAD = 6.0
"""The histogram covers so many standard deviations about the mean, within what is possible."""
SUMS = {
    "phi_1": "the involute stage",
    "phi_2": "the cycloid stage, below 0: interference",
    "phi_3": "the output stage",
    "backlash": "phi_1 + max(0, phi_2) + phi_3",
}
OUTPUTS = (
    *(output(f"{name}_mean_arcmin", f"mean of {text}") for name, text in SUMS.items()),
    *(output(f"{name}_std_arcmin", f"standard deviation of {text}") for name, text in SUMS.items()),
    output("backlash_least_arcmin", "least backlash drawn"),
    output("backlash_most_arcmin", "largest backlash drawn"),
    output("cp", "(upper - lower limit)/(6 std) of the backlash"),
    output("cpk", "distance of its mean from the nearer limit over 3 std"),
    output("cpk_upper", "distance of its mean from the upper limit over 3 std"),
    output("units", "units drawn"),
    output("yield_percent", "units within the backlash limit"),
    output("above_limit_percent", "units above it"),
    output("above_limit_units", "the same, their number"),
    output("above_limit_ppm", "the same, parts per million"),
    output("interference_percent", "units that interfere (phi_2 < 0)"),
    output("exact_backlash_mean_arcmin", "mean by convolution, without drawing"),
    output("exact_backlash_std_arcmin", "standard deviation by convolution"),
    output("exact_yield_percent", "yield by convolution"),
    output("exact_interference_percent", "interference by convolution"),
)


class ReducerMonteCarlo(Calculation):
    """Backlash of units drawn from the tolerance zones: spread, capability, yield, histogram."""

    name = "reducer_monte_carlo"
    about = "Backlash of units drawn from their tolerance zones: spread, capability and yield."
    reference = "document B, Monte Carlo simulation"
    outputs = OUTPUTS
    parameters = (
        *PARAMETERS,
        parameter("units", 1000, "units drawn", "document B", 2, 1e9),
        assumed(
            "lower_limit_arcmin",
            0.0,
            "lower limit in Cp and Cpk: no unit has less than none",
            "assumed: document B names none",
            -1e4,
            1e4,
        ),
        assumed("bins", 50, "bins of the histogram", low=1, high=10_000),
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        total = total_of(model_of(parameters), parameters)
        if float(total_cumulants(total.free)[1][0]) == 0.0:
            raise refuse("parameters", "gears and bearings do not vary, so that Cp may not exist; open a tolerance")
        limit = number(parameters["backlash_limit_arcmin"]) * ARCMIN
        exact = Convolution().propagate(total, COVERAGE, limit)
        edges = _edges(total, exact, int(number(parameters["bins"])))
        drawn = batch(total, int(number(parameters["units"])), limit, edges, rng)
        numbers = _spread(drawn) | _capability(drawn, parameters) | _proportions(drawn) | _exact(exact)
        return Computed(quantities(numbers), (_histogram(drawn, parameters), _compare_with_exact(numbers)))


def _edges(total: ClippedSum, exact: Propagated, bins: int) -> np.ndarray:
    """Edges [rad] of the histogram of the backlash."""
    free, clipped = ([term.bounds() for term in part] for part in (total.free, total.clipped))
    ends = [
        sum(float(bounds[side][0]) for bounds in free) + max(0.0, sum(float(bounds[side][0]) for bounds in clipped))
        for side in (0, 1)
    ]
    mean, std = float(exact.mean.value[0]), float(exact.std.value[0])
    low, high = max(ends[0], mean - SPREAD * std), min(ends[1], mean + SPREAD * std)
    return np.linspace(low, high if high > low else low + ARCMIN, bins + 1)


def _scale_estimate(estimate: Stated, scale: float) -> Stated:
    return Stated(estimate.value * scale, estimate.error * scale)


def _spread(drawn: Batch) -> dict[str, Stated]:
    statistics = {}
    for name, sums in drawn.sums.items():
        statistics[f"{name}_mean_arcmin"] = _scale_estimate(sums.mean, 1.0 / ARCMIN)
        statistics[f"{name}_std_arcmin"] = _scale_estimate(sums.std, 1.0 / ARCMIN)
    ends = {"least": drawn.least, "most": drawn.most}
    return statistics | {f"backlash_{k}_arcmin": Stated(v / ARCMIN, 0.0) for k, v in ends.items()}


def _capability(drawn: Batch, parameters: Mapping[str, Value]) -> dict[str, Stated]:
    sums = drawn.sums["backlash"]
    lower, upper = (number(parameters[name]) * ARCMIN for name in ("lower_limit_arcmin", "backlash_limit_arcmin"))
    return {"cp": sums.cp(lower, upper), "cpk": sums.cpk(lower, upper), "cpk_upper": sums.to_limit(upper, 1)}


def _proportions(drawn: Batch) -> dict[str, Stated]:
    count = drawn.units
    beyond = count - drawn.conforming
    above = share(beyond, count)
    return {
        "units": Stated(float(count), 0.0),
        "yield_percent": _scale_estimate(share(drawn.conforming, count), 100.0),
        "above_limit_percent": _scale_estimate(above, 100.0),
        "above_limit_units": Stated(float(beyond), above.error * count),
        "above_limit_ppm": _scale_estimate(above, 1e6),
        "interference_percent": _scale_estimate(share(drawn.interfering, count), 100.0),
    }


def _exact(exact: Propagated) -> dict[str, Stated]:
    """The same by convolution, which draws nothing; the errors are numerical."""
    named = {
        "exact_backlash_mean_arcmin": (exact.mean, 1.0 / ARCMIN),
        "exact_backlash_std_arcmin": (exact.std, 1.0 / ARCMIN),
        "exact_yield_percent": (exact.conforming, 100.0),
        "exact_interference_percent": (exact.negative, 100.0),
    }
    return {
        name: _scale_estimate(Stated(float(estimate.value[0]), float(estimate.error[0])), scale)
        for name, (estimate, scale) in named.items()
    }


def _histogram(drawn: Batch, parameters: Mapping[str, Value]) -> ComputedTable:
    edges = drawn.edges / ARCMIN
    counts = np.append(drawn.counts, 0)
    limits = {"limit": number(parameters["backlash_limit_arcmin"])}
    lower = number(parameters["lower_limit_arcmin"])
    if lower > edges[0]:
        limits["lower limit"] = lower
    chart = Chart("histogram", "from_arcmin", ("units",), limits)
    meaning = "Units by backlash; the outermost bins hold what lies beyond them as well"
    columns = {"from_arcmin": edges, "units": counts, "above_limit": edges >= limits["limit"]}
    return make_table("histogram", meaning, columns, chart)


def _compare_with_exact(numbers: Mapping[str, Stated]) -> ComputedTable:
    """Drawn and exact values, and how many standard errors lie between."""
    names = [name.removeprefix("exact_") for name in numbers if name.startswith("exact_")]
    drawn, exact = ([numbers[f"{of}{name}"] for name in names] for of in ("", "exact_"))
    columns = {
        "quantity": names,
        "drawn": [estimate.value for estimate in drawn],
        "standard_error": [estimate.error for estimate in drawn],
        "exact": [estimate.value for estimate in exact],
        "standard_errors_apart": [
            (estimate.value - reference.value) / estimate.error
            for estimate, reference in zip(drawn, exact, strict=True)
        ],
    }
    return make_table("against_convolution", "Units drawn, and the same without drawing", columns)


# Sensitivities of backlash to the errors of document B, by exact contact of every pin.


PHASES = 72
"""Phases of an error that turns with its disc, among which the worst is sought."""

MEANINGS: Mapping[str, str] = MappingProxyType(
    {
        "pin_circle_radius": "radius of the pin circle",
        "pin_position_adverse": "position of pins along the circle, opposite on the two flanks",
        "pin_hole_radius": "radius of the pin holes",
        "pin_radius": "radius of the pins",
        "pitch_worst_phase": "cumulative pitch error of the disc, at its worst phase",
        "runout_worst_phase": "radial runout of the disc, at its worst phase",
        "equidistance": "equidistance modification",
        "shift": "shift modification",
        "eccentricity": "eccentricity",
        "crank_bearing": "clearance of the crank-arm bearings",
    }
)
"""Change of backlash times e z_c per unit of each of these, for small errors."""


@dataclass(frozen=True, slots=True)
class Finite:
    """Central differences of the mean backlash of one disc over a pin pitch, times e z_c."""

    contact: LoadedContact
    angles: Array
    step: float

    def backlash(self, errors: PartErrors) -> Array:
        """Backlash against the mesh, as a gap e z_c phi [m], (units, angles)."""
        geometry = self.contact.geometry
        scale = geometry.output_ratio * geometry.nominal.lever
        return backlash(self.contact, errors, self.angles) * scale

    def mean(self, name: str, shape: tuple[int, ...]) -> float:
        """The difference by an error that all pins or teeth have in common."""
        ends = [self.backlash(PartErrors(**{name: np.full(shape, sign * self.step)})).mean() for sign in (1.0, -1.0)]
        return float(ends[0] - ends[1]) / (2.0 * self.step)

    def adverse_position(self) -> float:
        """That by pins displaced along the circle, on both flanks so that the gap opens."""
        phase = self.contact.geometry.phase(self.angles)[:, 0, :]
        side = np.sign(np.sin(phase))[:, None, :] * self.step  # a unit for every angle
        ends = [np.diagonal(self.backlash(PartErrors(tangential_position=sign * side))).mean() for sign in (-1.0, 1.0)]
        return abs(float(ends[0] - ends[1])) / (2.0 * self.step)

    def worst_phase(self, name: str, size: float) -> float:
        """That by an error that turns with the disc, at its worst phase and angle."""
        phase = 2.0 * np.pi * np.arange(PHASES)[:, None] / PHASES
        moved = PartErrors(**{name: np.full((1, 1), size * self.step), f"{name}_phase": phase})
        return float(np.max(self.backlash(moved) - self.backlash(PartErrors()))) / self.step


class CycloidContact(Calculation):
    """Sensitivity of backlash to each error of the cycloid stage, by exact geometry of 40 pins."""

    name = "cycloid_contact"
    about = "Sensitivity of backlash to each error of the cycloid stage, by exact 40-pin geometry."
    reference = "document B, table of relative sensitivities"
    sampled = False
    outputs = tuple(Output(name, "1", meaning) for name, meaning in MEANINGS.items())
    parameters = (
        parameter("dr_rp_mm", -0.040, "equidistance modification", "document B"),
        parameter("dr_p_mm", -0.070, "shift modification", "document B"),
        assumed(
            "step_um",
            0.1,
            "size of the error in the central differences",
            "assumed: far below the modification",
            0.0,
            10.0,
            open_low=True,
        ),
        assumed("angles", 40, "crank angles over a pin pitch", low=1, high=1000),
        parameter(
            "true_levers", True, "lever arms of the modified profile; otherwise those of the unmodified one", "geometry"
        ),
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        sensitivities = _sensitivities(_finite_contact(self.completed(values)))
        table = ComputedTable(
            "sensitivities",
            "Change of backlash times e z_c per unit of each error, by exact contact of 40 pins; "
            "document B prints half of most",
            (Axis("error", ""), Axis("exact", "1", "by exact contact")),
            (np.array(list(sensitivities)), np.array(list(sensitivities.values()))),
        )
        return Computed(quantities(sensitivities), (table,))


def _finite_contact(values: Mapping[str, Value]) -> Finite:
    geometry = ContactGeometry(
        dr_rp=number(values["dr_rp_mm"]) * MM,
        dr_p=number(values["dr_p_mm"]) * MM,
        discs=1,
        cranks=1,
        true_levers=bool(values["true_levers"]),
    )
    count = int(number(values["angles"]))
    angles = 2.0 * np.pi / geometry.pins * np.arange(count) / count
    return Finite(LoadedContact(geometry), angles, number(values["step_um"]) * UM)


def _sensitivities(by: Finite) -> dict[str, float]:
    pin, disc = (1, 1, 1), (1, 1)
    clearance = by.backlash(PartErrors(bearing_clearance=np.full(pin, by.step)))
    return {
        "pin_circle_radius": by.mean("circle_radius", (1,)),
        "pin_position_adverse": by.adverse_position(),
        "pin_hole_radius": by.mean("hole_radius", pin),
        "pin_radius": by.mean("pin_radius", pin),
        "pitch_worst_phase": by.worst_phase("pitch", 1.0),
        "runout_worst_phase": by.worst_phase("disc_offset", 0.5),
        "equidistance": by.mean("equidistance", disc),
        "shift": by.mean("shift", disc),
        "eccentricity": by.mean("eccentricity", pin),
        "crank_bearing": float(np.mean(clearance - by.backlash(PartErrors()))) / by.step,
    }


# Staggered assembly of the two discs: backlash against interference, and the parts it takes.


STAGGERED_COVERAGE = 0.9973
ANGLES = 40
"""Crank angles over a pin pitch at which the contact model is evaluated."""


STATISTICS = {
    "backlash_mean_arcmin": "mean of the backlash over units",
    "backlash_std_arcmin": "its standard deviation",
    "backlash_quantile_arcmin": "its quantile at 0.9973",
    "above_limit_percent": "units above the backlash limit",
    "interference_percent": "units that interfere (phi_2 < 0)",
    "backlash_most_arcmin": "largest backlash that the zones allow",
}
STAGGERED_OUTPUTS = (
    *(output(name, f"{text}, staggered") for name, text in STATISTICS.items()),
    *(output(f"without_{name}", f"{text}, no stagger") for name, text in STATISTICS.items()),
    output(
        "stagger_for_every_unit_arcmin",
        "least stagger at which the zones allow no unit above "
        "the limit; infinite where the other stages alone exceed it",
    ),
    output("turn_of_disc_arcmin", "the stagger: turn of each disc, one ahead and one back"),
    output("hole_offset_um", "for it: offset of a disc's bearing holes along their circle"),
    output("blank_angle_mrad", "or: angle at which the profile is machined to the holes"),
    output("blank_at_rim_um", "the same on the radius of the pin circle"),
    output("journal_phase_mrad", "or: phase of a disc's journals on all cranks"),
    output("journal_offset_um", "the same as a displacement of the journal's centre"),
    output(
        "contact_by_turn_arcmin", "what the contact model says that turned discs take from the backlash of the discs"
    ),
    output("contact_by_journals_arcmin", "the same of discs on journals ahead and behind"),
)


class StaggeredAssembly(Calculation):
    """Backlash and interference against the stagger, and the parts that make it.

    The stagger is the turn of each disc, one ahead and one back: twice the delta' of document B.
    """

    name = "staggered_assembly"
    about = "Backlash against interference over the stagger of the discs, and the parts it takes."
    reference = "document B, structural adjustment"
    sampled = False
    outputs = STAGGERED_OUTPUTS
    parameters = (
        *(parameter for parameter in PARAMETERS if parameter.name != "stagger_arcmin"),
        parameter(
            "stagger_arcmin",
            0.2,
            "turn of each disc, one ahead and one back, for the quantities",
            "document B: twice its delta'",
            0.0,
            60.0,
        ),
        assumed("stagger_most_arcmin", 0.6, "end of the sweep", low=0.0, high=60.0, open_low=True),
        assumed("points", 31, "points of the sweep", low=2, high=10_000),
    )

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        parameters = self.completed(values)
        model = model_of(parameters)
        limit = number(parameters["backlash_limit_arcmin"]) * ARCMIN
        at = np.array([0.0, number(parameters["stagger_arcmin"])])
        total = total_of(model, parameters, stagger_arcmin=at)
        numbers = _outcome(Convolution().propagate(total, STAGGERED_COVERAGE, limit), total, limit, model)
        numbers |= {name: float(column[1]) for name, column in _dimensions(model.geometry, at).items()}
        numbers |= _contact(model.geometry, parameters, at[1] * ARCMIN)
        sweep = np.linspace(0.0, number(parameters["stagger_most_arcmin"]), int(number(parameters["points"])))
        swept = total_of(model, parameters, stagger_arcmin=sweep)
        table = _sweep(sweep, Convolution().propagate(swept, STAGGERED_COVERAGE, limit))
        return Computed(quantities(numbers), (table, _mountings(sweep, model.geometry)))


def _largest_angles(total: ClippedSum) -> tuple[Array, Array]:
    """Largest phi_1 + phi_3 and phi_2 that the zones allow [rad], each (n,)."""
    free, clipped = (np.sum([term.bounds()[1] for term in part], axis=0) for part in (total.free, total.clipped))
    return free, clipped


def _outcome(propagated: Propagated, total: ClippedSum, limit: float, model: BacklashModel) -> dict[str, float]:
    """Without and with the stagger (rows 0 and 1)."""
    free, clipped = _largest_angles(total)
    worst = free + np.maximum(clipped, 0.0)
    columns = _statistics(propagated) | {"backlash_most_arcmin": worst / ARCMIN}
    named = {
        f"{prefix}{name}": float(column[row])
        for row, prefix in ((0, "without_"), (1, ""))
        for name, column in columns.items()
    }
    needed = np.maximum(free[0] + clipped[0] - limit, 0.0) / (model.output_factor * model.stagger_gain)
    reached = needed if free[0] <= limit else np.inf
    return named | {"stagger_for_every_unit_arcmin": float(reached) / ARCMIN}


def _statistics(propagated: Propagated) -> dict[str, Array]:
    return {
        "backlash_mean_arcmin": propagated.mean.value / ARCMIN,
        "backlash_std_arcmin": propagated.std.value / ARCMIN,
        "backlash_quantile_arcmin": propagated.quantile.value / ARCMIN,
        "above_limit_percent": 100.0 * (1.0 - propagated.conforming.value),
        "interference_percent": 100.0 * propagated.negative.value,
    }


def _dimensions(geometry: RvGeometry, staggers: Array) -> dict[str, Array]:
    """What a disc is turned by, and each alternative to do it; the other disc is the opposite."""
    parts = stagger.parts(geometry, staggers * ARCMIN)
    return {
        "turn_of_disc_arcmin": staggers,
        "hole_offset_um": parts.hole_offset / UM,
        "blank_angle_mrad": parts.blank_angle / MRAD,
        "blank_at_rim_um": parts.at_rim / UM,
        "journal_phase_mrad": parts.journal_phase / MRAD,
        "journal_offset_um": parts.at_journal / UM,
    }


def _contact(geometry: RvGeometry, parameters: Mapping[str, Value], turn: float) -> dict[str, float]:
    """What the contact model says that the discs' turn takes from the backlash of the discs."""
    dr_rp, dr_p = (number(parameters[name]) * MM for name in ("dr_rp_mm", "dr_p_mm"))
    contact = LoadedContact(ContactGeometry(geometry, dr_rp, dr_p), exact=True)
    phase = float(stagger.parts(geometry, np.array([turn])).journal_phase[0])
    mountings = {
        "": PartErrors(),
        "contact_by_turn_arcmin": PartErrors(angle=np.array([[turn, -turn]])),
        "contact_by_journals_arcmin": PartErrors(crank_phase=np.array([[[-phase, phase]]])),
    }
    angles = 2.0 * np.pi / geometry.pins * np.arange(ANGLES) / ANGLES
    ratio = contact.geometry.output_ratio / ARCMIN
    play = {name: backlash(contact, errors, angles).mean() * ratio for name, errors in mountings.items()}
    return {name: float(play[""] - value) for name, value in play.items() if name}


def _sweep(sweep: Array, propagated: Propagated) -> ComputedTable:
    columns = {"stagger_arcmin": sweep} | _statistics(propagated)
    meaning = "Backlash (quantile at 0.9973) and interference (phi_2 < 0) over the stagger"
    chart = Chart("lines", "stagger_arcmin", ("above_limit_percent", "interference_percent"))
    return make_table("sweep", meaning, columns, chart)


def _mountings(sweep: Array, geometry: RvGeometry) -> ComputedTable:
    columns = {"stagger_arcmin": sweep} | _dimensions(geometry, sweep)
    meaning = (
        "Three mountings to the stagger, each alone, of either disc (the other one opposite): bearing "
        "holes offset along their circle, blank turned to its holes, journals of all cranks ahead"
    )
    return make_table("ways", meaning, columns)
