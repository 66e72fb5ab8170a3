"""Monte Carlo of the backlash of reducers, through all three stages."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....declarations import Value, number
from ....errors import refuse
from ....models.propagation import Convolution, Propagated
from ....models.propagation.power_sums import Stated, share
from ....models.propagation.sums import ClippedSum, total_cumulants
from ....models.rv_reducer.stages import Batch, batch
from ....units import ARCMIN
from ..calculation import Calculation, Chart, Computed, ComputedTable
from . import reducer_inputs
from .results import assumed, output, parameter, quantities, tabulated

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
        *reducer_inputs.PARAMETERS,
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
        total = reducer_inputs.total_of(reducer_inputs.model_of(parameters), parameters)
        if float(total_cumulants(total.free)[1][0]) == 0.0:
            raise refuse("parameters", "gears and bearings do not vary, so that Cp may not exist; open a tolerance")
        limit = number(parameters["backlash_limit_arcmin"]) * ARCMIN
        exact = Convolution().propagate(total, COVERAGE, limit)
        edges = _edges(total, exact, int(number(parameters["bins"])))
        drawn = batch(total, int(number(parameters["units"])), limit, edges, rng)
        numbers = _spread(drawn) | _capability(drawn, parameters) | _proportions(drawn) | _exact(exact)
        return Computed(quantities(numbers), (_histogram(drawn, parameters), _compared(numbers)))


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


def _scaled(estimate: Stated, scale: float) -> Stated:
    return Stated(estimate.value * scale, estimate.error * scale)


def _spread(drawn: Batch) -> dict[str, Stated]:
    statistics = {}
    for name, sums in drawn.sums.items():
        statistics[f"{name}_mean_arcmin"] = _scaled(sums.mean, 1.0 / ARCMIN)
        statistics[f"{name}_std_arcmin"] = _scaled(sums.std, 1.0 / ARCMIN)
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
        "yield_percent": _scaled(share(drawn.conforming, count), 100.0),
        "above_limit_percent": _scaled(above, 100.0),
        "above_limit_units": Stated(float(beyond), above.error * count),
        "above_limit_ppm": _scaled(above, 1e6),
        "interference_percent": _scaled(share(drawn.interfering, count), 100.0),
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
        name: _scaled(Stated(float(estimate.value[0]), float(estimate.error[0])), scale)
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
    return tabulated("histogram", meaning, columns, chart)


def _compared(numbers: Mapping[str, Stated]) -> ComputedTable:
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
    return tabulated("against_convolution", "Units drawn, and the same without drawing", columns)
