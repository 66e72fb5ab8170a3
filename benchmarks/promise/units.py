"""`python -m benchmarks.promise.units`: promises of units by exact contact, kept or not.

Four errors of an RV reducer are known by samples of n parts. Each repeat draws the samples, finds
the least cost by the estimates and assured, and builds the units by the true processes: a promise
is kept where at least 99.73 % of these have at most 1 arcmin of backlash.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import gettempdir

import numpy as np
from scipy import stats

from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.models.capability import PartSample, knowledge_of
from tolevo.problems.promise import ASSURED, PLUG_IN, Promise
from tolevo.problems.rv_reducer import RvReducer
from tolevo.problems.settings import Bound, Settings, VariableSetting

from ..kept import keep, kept

MADE_TO = {"pin_circle_radius_um": 8.0, "pin_radius_um": 4.0, "pitch_um": 10.0,
           "eccentricity_um": 5.0}  # fmt: skip
SMALL = {"positions": 7, "search_units": 256, "report_units": 512, "elastic_units": 16}
SIZES = (10, 20)
SHARE = 99.73


@dataclass(frozen=True, slots=True)
class Units:
    """Costs, true yields [percent] and CPU seconds of both allocations, NaN without one."""

    plug_in: float
    plug_in_yield: float
    plug_in_seconds: float
    assured: float
    assured_yield: float
    assured_seconds: float


def repeat(n: int, seed: int) -> Units:
    """Sample, allocate, and build the units."""
    rng, variables, truth = np.random.default_rng([41, n, seed]), {}, []
    for name, t in MADE_TO.items():
        values = t / 3.0 * rng.standard_normal(n)
        known = knowledge_of(values)
        sample = PartSample(values, known, t, 0.0, (), {})
        mid = next(v.mid for v in RvReducer.variables if v.name == name)
        variables[name] = VariableSetting(distribution=sample.distribution, mid=mid, sample=sample)
        truth.append((t / 3.0 / known.std, -known.mean / known.std))
    settings = Settings(
        parameters=dict(SMALL), variables=variables, objectives=("cost",),
        limits={"interference_probability": Bound(high=0.05)},
    )  # fmt: skip
    found: list[float] = []
    for statement in (PLUG_IN, ASSURED):
        problem = RvReducer(replace(settings, promise=Promise(SHARE, statement)))
        start = time.process_time()
        x = search(problem, Exact(), Budget(), 0).chosen
        seconds = time.process_time() - start
        if not len(x) or np.any(problem.tested(x)[1] > 0.0):
            found += [float("nan"), float("nan"), seconds]
            continue
        design = problem.complete(x)
        scale, shift = np.array(truth).T
        cost = float(problem.cost_of(design)[0])
        found += [cost, problem.yield_at(design[0], scale, shift, False), seconds]
    return Units(*found)


def row(n: int, own: Sequence[Units]) -> str:
    """The line of one size of samples."""
    plain = [one.plug_in_yield >= SHARE for one in own if np.isfinite(one.plug_in)]
    made = [one.assured_yield >= SHARE for one in own if np.isfinite(one.assured)]
    good = sum(made)
    low = float(stats.beta.ppf(0.05, good, len(made) - good + 1)) if good else 0.0
    both = [one for one in own if np.isfinite(one.assured + one.plug_in)]
    cost = np.mean([one.assured / one.plug_in for one in both])
    cpu = sum(o.assured_seconds for o in own) / sum(o.plug_in_seconds for o in own)
    return (
        f"| rv_reducer, n = {n} | {100.0 * np.mean(plain):.1f} % | {100.0 * np.mean(made):.1f} "
        f"% | {100.0 * low:.1f} % | {cost:.3f} | {cpu:.1f} | {len(made)} of {len(own)} |"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Repeat every size, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200, help="repeats of each size")
    parser.add_argument("--n", type=int, nargs="*", default=SIZES, help="sizes of the samples")
    parser.add_argument("--kept", type=Path, default=Path(gettempdir(), "tolevo_units.jsonl"),
                        help="file of results, by which an interrupted run goes on")  # fmt: skip
    given = parser.parse_args(arguments)
    known = {(one.pop("n"), one.pop("seed")): Units(**one) for one in kept(given.kept)}
    print("| units | plug-in kept | assured kept | lower 95 % limit | cost | CPU | assured |\n"
          "|---|---:|---:|---:|---:|---:|---:|")  # fmt: skip
    for n in given.n:
        for seed in range(given.count):
            if (n, seed) not in known:
                known[n, seed] = one = repeat(n, seed)
                keep(given.kept, {"n": n, "seed": seed} | asdict(one))
        print(row(n, [known[n, seed] for seed in range(given.count)]), flush=True)


if __name__ == "__main__":
    main()
