"""`python -m benchmarks.rv_levels`: `rv_backlash` at 20 levels of backlash, proven, and its peers.

At most 5 % of the units interfere. A level is solved by itself: bound, allocation of the full
model, and their gap. Then the fronts of `exact`, `hybrid` and `nsga2` (18,000 evaluations): the
cheapest point that keeps each level, each in the run's own time.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tolevo.algorithms.exact.bounds import proof, row_limits
from tolevo.algorithms.exact.choices import least_cost
from tolevo.algorithms.exact.corrected import Corrected
from tolevo.algorithms.exact.solver import Exact, closed_form
from tolevo.algorithms.hybrid import Hybrid
from tolevo.algorithms.nsga2 import NSGA2
from tolevo.algorithms.run import Run
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import AlgorithmSettings, Budget, Crossover, Mutation
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import Bound, Settings
from tolevo.section import Value

from .outcome import kept_values, verdict

Array = NDArray[np.float64]
Parameters = Mapping[str, Value]
HALVED: Parameters = {"reading": "printed", "eccentricity_factor": 1.0, "position_mids_count": False, "planets": 1}
READINGS: Mapping[str, tuple[Parameters, float, float]] = {
    "as printed": ({"reading": "printed"}, 0.5, 1.0),
    "law of the eccentricity halved, two mids 0, one planet": (HALVED, 0.2, np.inf),
    "`consistent`, the tighter of two planets": ({"reading": "consistent"}, np.inf, np.inf),
}
"""Parameters; median and largest gap [percent] that are promised."""
LEVELS, TIGHT = np.geomspace(0.8, 4.0, 20), np.geomspace(0.57, 0.79, 8)
SECONDS = 2.0, 6.0
"""CPU of a level, median and largest [s]."""
EVALUATIONS = 18_000
MANY = 200
LEAST = 1.01
"""Least backlash of a front over the proven one, at most."""


@dataclass(frozen=True, slots=True)
class Level:
    """A level solved by itself: cost, gap [percent] and CPU [s]; NaN where no design is found."""

    level: float
    cost: float
    gap: float
    seconds: float


def problem_of(parameters: Parameters) -> RvBacklash:
    limits = {"interference_probability": Bound(high=0.05)}
    return RvBacklash(Settings(parameters=dict(parameters), limits=limits))


def levels(parameters: Parameters, asked: Array) -> list[Level]:
    problem = problem_of(parameters)
    form = closed_form(problem)
    assert form is not None
    corrected, found = Corrected(Run(problem, Budget(), 1), form), []
    for level in asked.tolist():
        start, limits = time.process_time(), row_limits(problem, form)
        limits[form.outputs.index("backlash_arcmin")] = level
        own = least_cost(form, limits[None, :])
        point = corrected.best(tuple(own.chosen[0].tolist()), limits)
        cost = np.nan if point is None else point.cost
        values = {"cost": np.array([cost]), "backlash_arcmin": np.array([level])}
        gap = float(proof(problem, values, 1).gap_percent(values["cost"])[0])
        found.append(Level(level, cost, gap, time.process_time() - start))
    return found


def front(algorithm: AlgorithmSettings, budget: Budget) -> tuple[Array, Array, float]:
    """Backlash and cost (n,) of the points that keep all limits in full accuracy, and CPU [s]."""
    problem = problem_of({"reading": "printed"})
    start = time.process_time()
    found = search(problem, algorithm, budget, seed=1)
    seconds = time.process_time() - start
    out = kept_values(problem, found.chosen if len(found.chosen) else found.x)
    return out["backlash_arcmin"], out["cost"], seconds


def cheapest(found: tuple[Array, Array, float], asked: Array) -> Array:
    """Least cost (n,) within each level, inf where a front has none."""
    backlash, cost, _ = found
    return np.array([np.min(cost, where=backlash <= level, initial=np.inf) for level in asked])


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--levels", type=int, default=len(LEVELS))
    asked = np.geomspace(0.8, 4.0, parser.parse_args(arguments).levels)
    print("| `rv_backlash`, 20 levels 0.8' to 4' | gap, median | largest | CPU s a level, median "
          "| largest | |\n|---|---:|---:|---:|---:|---|")  # fmt: skip
    for name, (parameters, median, most) in READINGS.items():
        print(_row(name, levels(parameters, asked), median, most), flush=True)
    tight = levels({"reading": "printed"}, TIGHT)
    print(_row("as printed, 8 levels 0.57' to 0.79'", tight, np.inf, np.inf), flush=True)
    _fronts(asked)


def _row(name: str, found: list[Level], median: float, most: float) -> str:
    gap = np.array([one.gap for one in found])
    seconds = np.array([one.seconds for one in found])
    kept = (np.median(gap) <= median and gap.max() <= most
            and np.median(seconds) <= SECONDS[0] and seconds.max() <= SECONDS[1])  # fmt: skip
    word = verdict(bool(kept) if np.isfinite(median) else None)
    return (f"| {name} | {np.median(gap):.3f} % | {gap.max():.3f} % | {np.median(seconds):.2f} "
            f"| {seconds.max():.2f} | {word} |")  # fmt: skip


def _fronts(asked: Array) -> None:
    """The fronts of three algorithms, and 200 points with their bounds."""
    problem = problem_of({"reading": "printed"})
    least = float(problem.box()[0][1])
    nsga2 = NSGA2(100, Crossover(eta=5.0), Mutation(eta=10.0))
    fronts = {
        "nsga2": front(nsga2, Budget(evaluations=EVALUATIONS)),
        "exact": front(Exact(points=MANY), Budget()),
        "hybrid": front(Hybrid(), Budget()),
    }
    own = cheapest(fronts["nsga2"], asked)
    print("\n| front | points | CPU s | least backlash over the proven one | cost below that of "
          "nsga2 at equal backlash, median | least | |\n"
          "|---|---:|---:|---:|---:|---:|---|")  # fmt: skip
    for name, found in fronts.items():
        cost = cheapest(found, asked)
        known = np.isfinite(own)
        saved = 100.0 * (1.0 - cost[known] / own[known])
        reach = float(found[0].min()) / least
        kept = bool(np.all(cost <= own)) and reach <= LEAST
        word = verdict(None if name == "nsga2" else kept)
        print(f"| `{name}` | {len(found[0])} | {found[2]:.0f} | {reach:.4f} "
              f"| {np.median(saved):.2f} % | {saved.min():.2f} % | {word} |",
              flush=True)  # fmt: skip
    backlash, cost, seconds = fronts["exact"]
    start = time.process_time()
    found_gap = proof(problem, {"cost": cost, "backlash_arcmin": backlash}, len(cost))
    seconds += time.process_time() - start
    gap = found_gap.gap_percent(cost)
    print(f"\n`exact`, {len(cost)} points with bounds: {seconds:.0f} s of CPU (300 promised), gap "
          f"{np.median(gap):.2f} % in the median, {gap.max():.2f} % at most.")  # fmt: skip


if __name__ == "__main__":
    main()
