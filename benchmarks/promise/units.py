"""`python -m benchmarks.promise.units`: promises of units by exact contact, kept or not.

Four errors of an RV reducer are known by samples of n parts. Each repeat draws the samples, finds
the least cost by the estimates, and from there assured, and builds other units by the true
processes: a promise is kept where at least 99.73 % of these have at most 1 arcmin of backlash.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tolevo.commands.run.promise import cheapest_design
from tolevo.models.capability import PartSample, knowledge_of
from tolevo.problems.rv_reducer import RvReducer
from tolevo.problems.settings import ASSURED, PLUG_IN, Bound, Promise, Settings, VariableSetting

from .repeated import Repeated, lowest, parser

Array = NDArray[np.float64]
MADE_TO = {"pin_circle_radius_um": 8.0, "pin_radius_um": 4.0, "pitch_um": 10.0,
           "eccentricity_um": 5.0}  # fmt: skip
POSITIONS, GRADE = 7, 4.0
"""Positions of a turn, and the grade of the involute stage, that of the cheapest units."""
BUILT = 65_536
"""Units that are built by the true processes: their yield is known to 0.02 %."""
SHARE = 99.73


@dataclass(frozen=True, slots=True)
class Reducer:
    """A reducer whose errors are known by samples of `n` parts."""

    n: int

    @property
    def key(self) -> str:
        """By which its results are kept."""
        return f"rv_reducer, n = {self.n}"


@dataclass(frozen=True, slots=True)
class Units:
    """Costs, true yields [percent] and CPU seconds of both allocations, NaN without one; what the
    assured one was said to be kept with [percent].
    """

    plug_in: float
    plug_in_yield: float
    plug_in_seconds: float
    assured: float
    assured_yield: float
    assured_seconds: float
    assurance: float


def repeat(case: Reducer, seed: int) -> Units:
    """Sample, allocate, and build the units."""
    rng, variables, truth = np.random.default_rng([41, case.n, seed]), {}, []
    for name, t in MADE_TO.items():
        values = t / 3.0 * rng.standard_normal(case.n)
        known = knowledge_of(values)
        sample = PartSample(values, known, t, 0.0, (), {})
        mid = next(v.mid for v in RvReducer.declaration.variables if v.name == name)
        variables[name] = VariableSetting(distribution=sample.distribution, mid=mid, sample=sample)
        truth.append((t / 3.0 / known.std, -known.mean / known.std))
    variables["involute_grade"] = VariableSetting(value=GRADE)
    settings = Settings(
        parameters={"positions": POSITIONS, "elastic_units": 16}, variables=variables,
        objectives=("cost",), limits={"interference_probability": Bound(high=0.05)}, seed=seed,
    )  # fmt: skip
    costs, yields, seconds = [], [], []
    near: Array | None = None
    for statement in (PLUG_IN, ASSURED):
        problem, start = promising(settings, statement), time.process_time()
        least = cheapest_design(problem, near)
        seconds.append(time.process_time() - start)
        costs.append(least.cost)
        yields.append(built(settings, statement, least.design, np.array(truth)))
        near = least.design
    assurance = problem.verdict(least.design).assurance if np.isfinite(least.cost) else np.nan
    return Units(costs[0], yields[0], seconds[0], costs[1], yields[1], seconds[1], assurance)


def promising(settings: Settings, statement: str) -> RvReducer:
    """The reducer with a promise."""
    return RvReducer(replace(settings, promise=Promise(SHARE, statement)))


def built(settings: Settings, statement: str, design: Array, truth: Array) -> float:
    """True yield [percent] of a full design (all,); NaN without one. `truth` (k, 2) has scales of
    the known scatter and errors of the means.
    """
    if not np.all(np.isfinite(design)):
        return float("nan")
    more = dict(settings.parameters) | {"report_units": BUILT}
    others = replace(settings, parameters=more, seed=1_000_000 + settings.seed)
    return promising(others, statement).yield_at(design, truth[:, 0], truth[:, 1], False)


def row(case: Reducer, own: Sequence[Units]) -> str:
    """The line of one size of samples; cost and CPU are medians."""
    plain = [one.plug_in_yield >= SHARE for one in own if np.isfinite(one.plug_in)]
    made = [one.assured_yield >= SHARE for one in own if np.isfinite(one.assured)]
    both = [one for one in own if np.isfinite(one.assured + one.plug_in)]
    cost = np.median([one.assured / one.plug_in for one in both])
    cpu = np.median([one.assured_seconds / one.plug_in_seconds for one in both])
    return (f"| {case.key} | {100.0 * np.mean(plain):.1f} % | {100.0 * np.mean(made):.1f} "
            f"% | {lowest(sum(made), len(made)):.1f} % | {cost:.3f} | {cpu:.1f} "
            f"| {len(made)} of {len(own)} |")  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> None:
    """Repeat every size, and print the table."""
    options = parser(__doc__, "units", 100)
    options.set_defaults(n=(10, 20))
    given = options.parse_args(arguments)
    repeats = Repeated(given.kept, repeat, Units)
    print("| units | plug-in kept | assured kept | lower 95 % limit | cost | CPU | assured |\n"
          "|---|---:|---:|---:|---:|---:|---:|")  # fmt: skip
    for n in given.n:
        own = repeats.each(Reducer(n), range(given.seed, given.seed + given.count))
        print(row(Reducer(n), own), flush=True)


if __name__ == "__main__":
    main()
