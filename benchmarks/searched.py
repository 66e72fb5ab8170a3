# ruff: noqa: E402 - the number of threads is fixed before numpy is imported
"""`python -m benchmarks.searched`: what NSGA-II takes within `search`, on arrays and by pymoo.

Both keep the archive and the hypervolume of every generation, as a run does. Cost against the root
sum of squares of 9 parts; the engines take turns in this one process, CPU time.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import time
from collections.abc import Sequence

import numpy as np

from tolevo.algorithms.nsga2 import NSGA2
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget

from .outcome import verdict
from .parts import PartsProblem
from .tasks.cost_rss import cost_rss

POPULATION, EVALUATIONS = 100, 20_000
PROMISED = 10.0
"""CPU of pymoo's NSGA-II over that of the array engine, at least."""


def microseconds(engine: str, seed: int) -> float:
    """CPU per evaluation [us] of a search with its archive and hypervolumes."""
    task = cost_rss(9)
    assert task.parts is not None
    problem = PartsProblem(task.parts, task.evaluate)
    start = time.process_time()
    found = search(problem, NSGA2(POPULATION), Budget(evaluations=EVALUATIONS), seed, engine=engine)
    return (time.process_time() - start) / found.evaluations * 1e6


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure in rounds of seeds, and print a line each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=6)
    parser.add_argument("--seeds", type=int, default=5)
    given = parser.parse_args(arguments)
    for engine in ("array", "pymoo"):
        microseconds(engine, 0)  # imports and caches
    ratios = []
    for number in range(given.rounds):
        seeds = range(number * given.seeds, (number + 1) * given.seeds)
        turns = [(microseconds("array", seed), microseconds("pymoo", seed)) for seed in seeds]
        array, pymoo = np.median(turns, axis=0)
        ratios.append(pymoo / array)
        print(f"seeds {seeds[0]} to {seeds[-1]}: pymoo {pymoo:.1f} us over array {array:.2f} us "
              f"an evaluation = {ratios[-1]:.2f}", flush=True)  # fmt: skip
    ratio = float(np.median(ratios))
    print(f"Median of {given.rounds} rounds: {ratio:.1f}, from {min(ratios):.1f} to "
          f"{max(ratios):.1f}; promised {PROMISED:.0f}: {verdict(ratio >= PROMISED)}.")  # fmt: skip


if __name__ == "__main__":
    main()
