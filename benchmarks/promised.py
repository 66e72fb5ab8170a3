"""The figures that are promised, from the runs of the comparison: what came out, met or not."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tolevo.algorithms.nsga2 import NSGA2
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget, Mutation
from tolevo.section import Array

from . import memory
from .outcome import verdict
from .peers import tolevo_exact
from .proven import Found, cases
from .task import REFERENCE, Recorder, Task

if TYPE_CHECKING:
    from .compare import Measured, Results

COMPILED = ("pygmo_nsga2", "vamos_nsga2")
ENOUGH = 5
"""Seeds of each that lie apart by chance in less than 1 % of all cases."""


@dataclass(frozen=True, slots=True)
class Figure:
    """What is measured, what came out, what was promised and whether that was kept.

    `met` is None where nothing was promised.
    """

    what: str
    value: str
    promised: str
    met: bool | None

    def row(self) -> str:
        return f"| {self.what} | {self.value} | {self.promised} | {verdict(self.met)} |"


def table(figures: Iterator[Figure]) -> str:
    head = "\n### Promised figures\n\n| figure | measured | promised | |\n|---|---:|---:|---|"
    return "\n".join([head, *(figure.row() for figure in figures)])


def figures(results: Results, tasks: list[Task], quick: bool) -> Iterator[Figure]:
    """All of them; those that need runs of their own are measured now."""
    yield from exact(results, tasks[0])
    yield from slsqp(results, tasks)
    yield from hybrid(quick)
    yield from engines(results, tasks)
    yield searched(tasks[0], 1 if quick else 5)
    yield from gde3(results, tasks)
    yield peak()


def median(runs: list[Measured], value: Callable[[Measured], float]) -> float:
    return float(np.median([value(run) for run in runs]))


def seconds(runs: list[Measured]) -> float:
    """CPU time to 99 %."""
    return median(runs, lambda run: run.reached[0][1])


# what `exact` promises


def true_share(task: Task, values: Array) -> float:
    """Share of the hypervolume under the chords of the stored front, which is convex.

    The staircase of its points misses half of every step, the chords nearly nothing.
    """
    ideal, nadir = task.front.min(axis=0), task.front.max(axis=0)
    points = np.unique((task.front - ideal) / (nadir - ideal), axis=0)
    steps = np.abs(np.diff(points, axis=0)).prod(axis=1)
    stairs = area(points)
    return task.share(values) * stairs / (stairs + 0.5 * float(steps.sum()))


def area(points: Array) -> float:
    """Area (2 objectives) from non-dominated points, ordered by the first, to the reference."""
    right = np.append(points[1:, 0], REFERENCE)
    return float(((right - points[:, 0]) * (REFERENCE - points[:, 1])).sum())


def exact(results: Results, task: Task) -> Iterator[Figure]:
    share = true_share(task, tolevo_exact.run(Recorder(task, np.inf), 0, 0))
    yield Figure("exact, 1000 points, 9 variables: share of the true hypervolume",
                 f"{100.0 * share:.4f} %", "99.95 %", share >= 0.9995)  # fmt: skip
    times = [seconds(results[task.name, name]) for name in ("pymoo_nsga2", "tolevo_exact")]
    ratio = times[0] / times[1]
    yield Figure("CPU of pymoo NSGA-II to 99 % over that of exact", f"{ratio:.0f}", "500",
                 ratio >= 500.0)  # fmt: skip


def slsqp(results: Results, tasks: list[Task]) -> Iterator[Figure]:
    for at, task in enumerate(tasks):
        count = median(results[task.name, "tolevo_slsqp"], lambda run: run.reached[1][0])
        value = f"{count:,.0f}" if np.isfinite(count) else "not reached"
        yield Figure(f"exact (SLSQP), {task.name}: evaluations to 99.9 %", value,
                     *(("3000", count <= 3000) if at == 0 else ("", None)))  # fmt: skip


# what `hybrid` promises


def hybrid(quick: bool) -> Iterator[Figure]:
    for case, found in cases(quick):
        seeds = {one.seed for one in found}
        hit = [all(one.optimal for one in found if one.seed == seed) for seed in sorted(seeds)]
        worst = max(found, key=lambda one: one.excess)
        promise = ("all", all(hit)) if case.promised else ("", None)
        yield Figure(f"hybrid, 36 process sets, {case.text}: seeds with the optimum at all "
                     f"{len(case.limits)} limits; worst excess of cost",
                     f"{sum(hit)} of {len(hit)}; {_percent(worst)}", *promise)  # fmt: skip


def _percent(one: Found) -> str:
    return f"{100.0 * one.excess:.2g} %" if np.isfinite(one.excess) else "nothing found"


# what the array engines promise


def engines(results: Results, tasks: list[Task]) -> Iterator[Figure]:
    for at, task in enumerate(tasks):
        runs = [results[task.name, name] for name in ("pymoo_nsga2", "tolevo_nsga2")]
        each = [median(one, lambda run: run.each) for one in runs]
        yield Figure(f"NSGA-II, {task.name}: CPU per evaluation, pymoo {1e6 * each[0]:.1f} us over "
                     f"array {1e6 * each[1]:.1f} us", f"{each[0] / each[1]:.1f}",
                     *(("10", each[0] >= 10.0 * each[1]) if at == 0 else ("", None)))  # fmt: skip
        shares = [np.array([run.returned for run in one]) for one in runs]
        overlap = bool(max(s.min() for s in shares) <= min(s.max() for s in shares))
        spans = " against ".join(f"{100 * s.min():.2f} to {100 * s.max():.2f}" for s in shares)
        if np.all(np.isfinite(np.concatenate(shares))):
            met = overlap if len(shares[0]) >= ENOUGH else None
            what = f"NSGA-II, {task.name}: returned front, pymoo against array"
            yield Figure(what, f"{spans} %", "seeds overlap", met)


def searched(task: Task, seeds: int) -> Figure:
    """Both NSGA-II as a run of tolevo searches, archive and progress included."""
    each: dict[str, list[float]] = {"pymoo": [], "array": []}
    assert task.problem is not None
    settings = NSGA2(mutation=Mutation(1.0 / len(task.low)))
    for seed in range(1, seeds + 1):
        for engine, times in each.items():
            problem = task.problem().watched(lambda _: None)
            start = time.process_time()
            found = search(problem, settings, Budget(evaluations=20_000), seed, engine=engine)
            times.append((time.process_time() - start) / found.evaluations)
    pymoo, array = (float(np.median(times)) for times in each.values())
    return Figure(f"NSGA-II by `search`, {task.name}: CPU per evaluation, pymoo {1e6 * pymoo:.1f} "
                  f"us over array {1e6 * array:.1f} us", f"{pymoo / array:.1f}", "10",
                  pymoo >= 10.0 * array)  # fmt: skip


def gde3(results: Results, tasks: list[Task]) -> Iterator[Figure]:
    for task in tasks:
        own = seconds(results[task.name, "tolevo_gde3"])
        peers = [seconds(runs) for name in COMPILED if (runs := results[task.name, name])]
        fastest = min(peers, default=np.inf)
        value = f"{own / fastest:.3f}" if np.isfinite(fastest) else "none reached it"
        promise = ("", None) if task.parts is None else ("1", bool(np.isfinite(own) and own <= fastest))
        yield Figure(f"array GDE3, {task.name}: CPU to 99 % over that of the fastest compiled peer",
                     value, *promise)  # fmt: skip


def peak() -> Figure:
    """In a process of its own: a child begins with the peak of its parent."""
    command = [sys.executable, "-m", "benchmarks.memory"]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    points, used = (float(part.split()[0]) for part in text.split(",")[:2])
    what = f"`tolevo run` with exact, {points:.0f} points, 9 parts: peak memory"
    promise = f"under {memory.LIMIT:.0f} MiB"
    return Figure(what, f"{used:.0f} MiB", promise, used < memory.LIMIT)
