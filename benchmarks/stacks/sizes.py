"""`python -m benchmarks.stacks.sizes`: large bills of parts, many requirements.

Each size runs in a process of its own, for its memory. With `monte_carlo` all requirements are
quantiles, half-widths that hold 99.73 %, and the parts have five even laws.
"""

from __future__ import annotations

import resource
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np

from tolevo.algorithms.exact.bounds import proof
from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget

from ..outcome import kept_values, verdict
from .drawn import problem_of
from .generated import stack_table

SEEDS = 5
THREE = 3


@dataclass(frozen=True, slots=True)
class Size:
    """Parts, requirements, parts with three processes, method; gap [%] and CPU [s] promised."""

    parts: int
    requirements: int
    several: int
    method: str
    gap: float = np.inf
    seconds: float = np.inf


SIZES = (
    Size(40, 12, 10, "rss", 0.1, 20.0),
    Size(40, 12, 10, "monte_carlo", 0.1, 20.0),
    Size(40, 12, 20, "monte_carlo"),
    Size(100, 12, 0, "rss", 0.1, 10.0),
    Size(100, 12, 0, "monte_carlo", 0.1, 10.0),
    Size(40, 30, 10, "rss"),
    Size(40, 30, 10, "monte_carlo"),
    Size(100, 30, 0, "monte_carlo"),
)
MEBIBYTES = 1024.0
"""Memory [MiB] that a process may take."""


def measured(size: Size, seed: int) -> tuple[float, float, float]:
    """Gap [%], CPU [s] of design and proof, and peak memory [MiB] of this process."""
    given = stack_table(size.parts, size.requirements, size.several, THREE, seed, (size.method,))
    start = time.process_time()
    problem = problem_of(given | {"propagation": {"coverage": 0.9973}})
    cost = kept_values(problem, search(problem, Exact(), Budget(), 1).x)["cost"]
    if not len(cost):
        return np.inf, time.process_time() - start, np.inf
    gap = proof(problem, {"cost": cost}, 1).gap_percent(cost)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return float(gap[0]), time.process_time() - start, memory


def main() -> None:
    """Measure all sizes, and print the table."""
    print("| parts | requirements | parts with 3 processes | method | gap, largest | CPU s, median "
          "| largest | MiB | |\n|---:|---:|---:|---|---:|---:|---:|---:|---|")  # fmt: skip
    for size in SIZES:
        found = []
        for seed in range(SEEDS):
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
                found.append(pool.submit(measured, size, seed).result())
        gap, seconds, memory = np.array(found).T
        kept = gap.max() <= size.gap and seconds.max() <= size.seconds and memory.max() <= MEBIBYTES
        word = verdict(bool(kept) if np.isfinite(size.gap) else None)
        print(f"| {size.parts} | {size.requirements} | {size.several} | `{size.method}` "
              f"| {gap.max():.1g} % | {np.median(seconds):.1f} | {seconds.max():.1f} "
              f"| {memory.max():.0f} | {word} |", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
