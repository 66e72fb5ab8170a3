"""Monte Carlo of the backlash of reducers, through all three stages."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....declarations import Parameter, Value, number
from ....models.propagation import Convolution, Propagated
from ....models.propagation.power_sums import PowerSums, Stated, share
from ....models.propagation.sums import ClippedSum
from ....models.rv_reducer.stages import Batch, batch
from ....units import ARCMIN
from ..calculation import Calculation, Chart, Computed, ComputedTable, Quantity
from . import reducer_inputs
from .tables import tabulated

COVERAGE = 0.9973
SPREAD = 6.0
"""The histogram covers so many standard deviations about the mean, within what is possible."""
SUMS = {"phi_1": "involute stage", "phi_2": "cycloid stage, below 0: interference",
        "phi_3": "output stage", "backlash": "phi_1 + max(0, phi_2) + phi_3"}  # fmt: skip


class ReducerMonteCarlo(Calculation):
    """Backlash of units drawn from the tolerance zones: spread, capability, yield, histogram."""

    name = "reducer_monte_carlo"
    about = "Backlash of units drawn from their tolerance zones: spread, capability and yield."
    reference = "document B, Monte Carlo simulation"
    parameters = (
        *reducer_inputs.PARAMETERS,
        Parameter("units", 1000, "", "units drawn", "document B", low=2, high=1e9),
        Parameter("lower_limit_arcmin", 0.0, "arcmin", "lower limit in Cp and Cpk: no unit has "
                  "less than none", "assumed: document B names none", assumed=True, low=-1e4,
                  high=1e4),
        Parameter("bins", 50, "", "bins of the histogram", "assumed", assumed=True, low=1,
                  high=10_000),
    )  # fmt: skip

    def compute(self, values: Mapping[str, Value], rng: np.random.Generator) -> Computed:
        given = self.completed(values)
        total = reducer_inputs.total_of(reducer_inputs.model_of(given), given)
        limit = number(given["backlash_limit_arcmin"]) * ARCMIN
        exact = Convolution().propagate(total, COVERAGE, limit)
        edges = _edges(total, exact, int(number(given["bins"])))
        drawn = batch(total, int(number(given["units"])), limit, edges, rng)
        quantities = _spread(drawn) | _capability(drawn, given) | _proportions(drawn)
        quantities |= _exact(exact)
        return Computed(quantities, (_histogram(drawn, given), _compared(quantities)))


def _edges(total: ClippedSum, exact: Propagated, bins: int) -> np.ndarray:
    """Edges [rad] of the histogram of the backlash."""
    free, clipped = ([term.bounds() for term in part] for part in (total.free, total.clipped))
    ends = [
        sum(float(one[side][0]) for one in free)
        + max(0.0, sum(float(one[side][0]) for one in clipped))
        for side in (0, 1)
    ]
    mean, std = float(exact.mean.value[0]), float(exact.std.value[0])
    low, high = max(ends[0], mean - SPREAD * std), min(ends[1], mean + SPREAD * std)
    return np.linspace(low, high if high > low else low + ARCMIN, bins + 1)


def _quantity(one: Stated, unit: str, scale: float = 1.0) -> Quantity:
    return Quantity(one.value * scale, unit, one.error * scale)


def _spread(drawn: Batch) -> dict[str, Quantity]:
    found = {}
    for name, sums in drawn.sums.items():
        found[f"{name}_mean_arcmin"] = _quantity(sums.mean, "arcmin", 1.0 / ARCMIN)
        found[f"{name}_std_arcmin"] = _quantity(sums.std, "arcmin", 1.0 / ARCMIN)
    return found | {
        "backlash_least_arcmin": Quantity(drawn.least / ARCMIN, "arcmin"),
        "backlash_most_arcmin": Quantity(drawn.most / ARCMIN, "arcmin"),
    }


def _capability(drawn: Batch, given: Mapping[str, Value]) -> dict[str, Quantity]:
    sums: PowerSums = drawn.sums["backlash"]
    names = ("lower_limit_arcmin", "backlash_limit_arcmin")
    lower, upper = (number(given[name]) * ARCMIN for name in names)
    if sums.std.value == 0.0:
        return {}
    return {
        "cp": _quantity(sums.cp(lower, upper), "1"),
        "cpk": _quantity(sums.cpk(lower, upper), "1"),
        "cpk_upper": _quantity(sums.to_limit(upper, 1), "1"),
    }


def _proportions(drawn: Batch) -> dict[str, Quantity]:
    count = drawn.units
    conforming, above = share(drawn.conforming, count), share(count - drawn.conforming, count)
    return {
        "units": Quantity(float(count), "1"),
        "yield_percent": _quantity(conforming, "percent", 100.0),
        "above_limit_percent": _quantity(above, "percent", 100.0),
        "above_limit_units": Quantity(float(count - drawn.conforming), "1"),
        "above_limit_ppm": _quantity(above, "1", 1e6),
        "interference_percent": _quantity(share(drawn.interfering, count), "percent", 100.0),
    }


def _exact(exact: Propagated) -> dict[str, Quantity]:
    """The same by convolution, which draws nothing; the errors are numerical."""
    named = {
        "exact_backlash_mean_arcmin": (exact.mean, "arcmin", 1.0 / ARCMIN),
        "exact_backlash_std_arcmin": (exact.std, "arcmin", 1.0 / ARCMIN),
        "exact_yield_percent": (exact.conforming, "percent", 100.0),
        "exact_interference_percent": (exact.negative, "percent", 100.0),
    }
    return {
        name: Quantity(float(one.value[0]) * scale, unit, float(one.error[0]) * scale)
        for name, (one, unit, scale) in named.items()
    }


def _histogram(drawn: Batch, given: Mapping[str, Value]) -> ComputedTable:
    edges = drawn.edges / ARCMIN
    counts = np.append(drawn.counts, 0)
    limits = {"limit": number(given["backlash_limit_arcmin"])}
    lower = number(given["lower_limit_arcmin"])
    if lower > edges[0]:
        limits["lower limit"] = lower
    chart = Chart("histogram", "from_arcmin", ("units",), limits)
    meaning = "Units by backlash; the outermost bins hold what lies beyond them as well"
    columns = {"from_arcmin": edges, "units": counts, "above_limit": edges >= limits["limit"]}
    return tabulated("histogram", meaning, columns, chart)


def _compared(quantities: Mapping[str, Quantity]) -> ComputedTable:
    """Drawn beside exact, and how many standard errors lie between."""
    names = [name.removeprefix("exact_") for name in quantities if name.startswith("exact_")]
    drawn = [quantities[name] for name in names]
    exact = [quantities[f"exact_{name}"] for name in names]
    away = [
        (one.value - other.value) / max(one.standard_error, 1e-300)
        for one, other in zip(drawn, exact, strict=True)
    ]
    columns = {
        "quantity": names,
        "drawn": [one.value for one in drawn],
        "standard_error": [one.standard_error for one in drawn],
        "exact": [one.value for one in exact],
        "standard_errors_apart": away,
    }
    return tabulated("against_convolution", "Units drawn, and the same without drawing", columns)
