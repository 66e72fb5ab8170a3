# ruff: noqa: E402 - the number of threads is fixed before numpy is imported
"""Optimisers side by side: `python -m benchmarks.compare [--quick]`, in Markdown.

One process, one thread, interleaved: every contender runs once on every task before any runs a
second time. docs/benchmarks.md says what is measured. With `--equal TASK=SECONDS ...` every contender,
`exact` as well, has as much CPU time on a task, and any number of evaluations; `--keep FILE` goes on where
such a run was stopped (`benchmarks/equal.jsonl` has the runs of docs/benchmarks.md), and `--write PAGE` puts its
table between the marks of a page.
"""

from __future__ import annotations

import os

for _name in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
    os.environ[f"{_name}_NUM_THREADS"] = "1"

import argparse
import gc
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType

import numpy as np

from tolevo.section import Array

from . import peers, promised
from .gap.page import made_by, written
from .kept import keep, kept
from .task import OutOfTime, Recorder, Task
from .tasks.cost_rss import cost_rss
from .tasks.mixed_process import mixed_process
from .tasks.rv_backlash import rv_backlash
from .tasks.rv_reducer import rv_reducer

LEVELS = (0.99, 0.999)
SHORT = 0.5
"""CPU seconds after which a run is not repeated."""
QUARTILES = 0.25, 0.5, 0.75
BASE = "pymoo_nsga2"
"""The contender whose CPU time is 1 in the table."""


@dataclass(frozen=True, slots=True)
class Effort:
    """Seeds, evaluations and CPU seconds of a run, minutes after which no round begins.

    The CPU seconds of `equal` tasks are those of every contender, and none is left uncut.
    """

    seeds: int = 5
    evaluations: int = 50_000
    seconds: float = 5.0
    minutes: float = 10.0
    equal: Mapping[str, float] = field(default_factory=dict)

    def limit(self, module: ModuleType, task: Task) -> float:
        """CPU seconds of a run."""
        if task.name in self.equal:
            return self.equal[task.name]
        return np.inf if getattr(module, "UNCUT", False) else self.seconds * task.patience


QUICK = Effort(1, 12_000, 1.5, 1.0)
ENOUGH = 10_000_000
"""Evaluations that no run of equal CPU time comes to."""
PART = "equal"
"""Part of the page with its table."""


@dataclass(frozen=True, slots=True)
class Measured:
    """Evaluations and CPU seconds to each of `LEVELS`; share of the front that was returned.

    `each` is the CPU time per evaluation [s] of the whole run, `seen` the share of the front that
    all designs evaluated in it have.
    """

    reached: tuple[tuple[float, float], ...]
    returned: float
    each: float
    seen: float = np.nan


Results = dict[tuple[str, str], list[Measured]]


def contenders() -> tuple[dict[str, ModuleType], dict[str, str]]:
    """Modules of `peers` by name, and why the others cannot be imported."""
    found, missing = {}, {}
    for module in iter_modules(peers.__path__):
        try:
            found[module.name] = import_module(f"{peers.__name__}.{module.name}")
        except ImportError as error:
            missing[module.name] = str(error)
    return found, missing


def measure(module: ModuleType, task: Task, seed: int, effort: Effort) -> Measured:
    """One run; of a contender that takes a millisecond, the median of several on end."""
    gc.collect()
    start = time.process_time()
    runs = [once(module, task, seed, effort)]
    while len(runs) < getattr(module, "REPEATS", 1) and time.process_time() - start < SHORT:
        runs.append(once(module, task, seed, effort))
    recorder, front = sorted(runs, key=lambda run: run[0].each)[len(runs) // 2]
    returned = np.nan if front is None else task.share(front)
    reached = tuple(recorder.reached(level) for level in LEVELS)
    return Measured(reached, returned, recorder.each, recorder.seen)


def once(module: ModuleType, task: Task, seed: int, effort: Effort) -> tuple[Recorder, Array | None]:
    """What was recorded, and the front that was returned; None where the time was over before."""
    recorder = Recorder(task, effort.limit(module, task))
    try:
        return recorder, module.run(recorder, seed, effort.evaluations)
    except OutOfTime:
        return recorder, None


def suits(module: ModuleType, task: Task) -> bool:
    """Whether a contender takes a task: every peer does."""
    return bool(getattr(module, "suits", lambda _: True)(task))


def rounds(
    found: dict[str, ModuleType], tasks: list[Task], effort: Effort, path: Path | None = None
) -> Iterator[tuple[str, str, Measured]]:
    """Every contender on every task, seed by seed, until the minutes are over; a file's runs are not repeated."""
    start, known = time.monotonic(), {} if path is None else _known(path, effort.equal)
    for module in found.values():  # compiles what is compiled at first use
        module.run(Recorder(tasks[0], np.inf), 0, 400)
    for seed in range(1, effort.seeds + 1):
        over = time.monotonic() - start > 60.0 * effort.minutes
        for task in tasks:
            for name, module in found.items():
                if not suits(module, task):
                    continue
                measured = known.get((task.name, name, seed))
                if measured is None:
                    if over:
                        continue
                    measured = measure(module, task, seed, effort)
                    if path is not None:
                        place = {"task": task.name, "name": name, "seed": seed, "limit": effort.limit(module, task)}
                        keep(path, place | asdict(measured))
                yield task.name, name, measured


def _known(path: Path, limits: Mapping[str, float]) -> dict[tuple[str, str, int], Measured]:
    """The runs that a file has with these CPU seconds, by task, contender and seed."""
    known = {}
    for run in kept(path):
        if run["limit"] == limits.get(run["task"]):
            reached = tuple((float(count), float(cpu)) for count, cpu in run["reached"])
            measured = Measured(reached, run["returned"], run["each"], run["seen"])
            known[run["task"], run["name"], run["seed"]] = measured
    return known


def number(value: float, form: str) -> str:
    return format(value, form) if np.isfinite(value) else "-"


def quartiles(values: list[float], form: str) -> str:
    """Median and quartiles over seeds; a median that most seeds did not reach is "-", such a quartile "never"."""
    low, median, high = (number(float(each), form) for each in np.quantile(values, QUARTILES, method="nearest"))
    if len(values) < len(QUARTILES) or median == "-":
        return median
    return f"{median} ({low}-{'never' if high == '-' else high})"


def row(label: str, runs: list[Measured], base: list[Measured]) -> str:
    """Medians, of CPU times with quartiles."""
    cells = [label]
    for level in range(len(LEVELS)):
        cells.append(number(float(np.median([run.reached[level][0] for run in runs])), ",.0f"))
        cells.append(quartiles([run.reached[level][1] for run in runs], ".4f"))
    own, other = (np.median([run.reached[0][1] for run in each]) for each in (runs, base))
    cells.append(number(float(own / other) if np.isfinite(other) else np.nan, ".3g"))
    shares = np.array([(run.seen, run.returned) for run in runs])
    cells += [number(100.0 * float(share), ".2f") for share in np.median(shares, axis=0)]
    return f"| {' | '.join(cells)} |"


def table(task: Task, results: Results, labels: dict[str, str]) -> str:
    """Fastest to 99 % first, then those that saw most of the front."""
    base = results[task.name, BASE]
    taken = [name for name in labels if results[task.name, name]]
    ordered = sorted(taken, key=lambda name: _speed(results[task.name, name]))
    head = (
        f"\n### {task.name}: {task.note}\n\n"
        "| | evaluations to 99 % | CPU s | evaluations to 99.9 % | CPU s | CPU to 99 %, relative "
        "| seen, % | returned front, % |\n|---|---:|---:|---:|---:|---:|---:|---:|"
    )
    return "\n".join([head, *(row(labels[n], results[task.name, n], base) for n in ordered)])


def equal_table(tasks: list[Task], results: Results, labels: dict[str, str], seconds: Mapping[str, float]) -> str:
    """Shares of the best hypervolume after equal CPU times, the largest of the first task first."""
    whole = {task.name: min(len(runs) for (of, _), runs in results.items() if of == task.name) for task in tasks}
    results = {(of, name): runs[: whole[of]] for (of, name), runs in results.items()}
    heads = [
        f"{task.name}, {whole[task.name]} {'seed' if whole[task.name] == 1 else 'seeds'} of {seconds[task.name]:g} s: "
        "hypervolume, %; CPU s to 99 %"
        for task in tasks
    ]
    taken = [name for name in labels if any((task.name, name) in results for task in tasks)]
    ordered = sorted(
        taken, key=lambda name: [_share(results.get((task.name, name), [])) for task in tasks], reverse=True
    )
    rows = []
    for name in ordered:
        cells = [labels[name]]
        for task in tasks:
            runs = results.get((task.name, name), [])
            share, reached = [100.0 * run.seen for run in runs], [run.reached[0][1] for run in runs]
            both = (quartiles(share, ".2f"), quartiles(reached, ".2g")) if runs else ("-",)
            cells.append("; ".join(both).removesuffix("; -"))
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join([f"| | {' | '.join(heads)} |", "|---" * (1 + len(tasks)) + "|", *rows])


def _share(runs: list[Measured]) -> float:
    return float(np.quantile([run.seen for run in runs], 0.5, method="nearest")) if runs else -np.inf


def _speed(runs: list[Measured]) -> tuple[float, float]:
    shortest = float(np.median([run.reached[0][1] for run in runs]))
    return shortest, -float(np.nanmedian([run.seen for run in runs]))


def release(module: ModuleType) -> str:
    try:
        return version(module.DISTRIBUTION)
    except PackageNotFoundError:
        return ""


def main() -> None:
    parser = argparse.ArgumentParser(description="Optimisers side by side.")
    parser.add_argument("--quick", action="store_true", help="one seed, small budgets")
    parser.add_argument("--seeds", type=int, help="at most so many rounds")
    parser.add_argument("--minutes", type=float, help="after which no round of seeds begins")
    parser.add_argument("--tasks", nargs="+", help="only those whose name has one of these words")
    parser.add_argument(
        "--equal", nargs="+", metavar="TASK=SECONDS", help="these tasks, CPU seconds of every contender"
    )
    parser.add_argument("--keep", type=Path, help="file by which a run of --equal goes on")
    parser.add_argument("--write", type=Path, help="page that gets the table of --equal")
    given = parser.parse_args()
    quick, effort = given.quick, QUICK if given.quick else Effort()
    if given.minutes is not None:
        effort = replace(effort, minutes=given.minutes)
    if given.seeds is not None:
        effort = replace(effort, seeds=given.seeds)
    if given.equal:
        limits = {name: float(seconds) for name, seconds in (one.split("=") for one in given.equal)}
        effort = replace(effort, equal=limits, evaluations=ENOUGH)
    found, missing = contenders()
    labels = {name: f"{module.DISTRIBUTION} {release(module)} {module.LABEL}" for name, module in found.items()}
    tasks = [cost_rss(9), cost_rss(12), mixed_process(), rv_backlash(), rv_reducer()]
    if given.tasks or given.equal:
        words = given.tasks or [*effort.equal]
        tasks = [task for task in tasks if any(word in task.name for word in words)]
    results: Results = defaultdict(list)
    for place, name, measured in rounds(found, tasks, effort, given.keep):
        results[place, name].append(measured)
    if given.equal:
        lines = equal_table(tasks, results, labels, effort.equal)
        print(lines)
        if given.write:
            command = made_by(f"python -m benchmarks.compare --equal {' '.join(given.equal)}")
            written(given.write, f"{command}\n\n{lines}", PART)
        return
    done = len(results[tasks[-1].name, BASE])
    print(f"Medians of {done} seeds; at most {effort.evaluations:,} evaluations and "
          f"{effort.seconds:g} CPU s a run; one thread.")  # fmt: skip
    for task in tasks:
        print(table(task, results, labels))
    if not given.tasks:
        print(promised.table(promised.figures(results, tasks, quick)))
    for name, reason in missing.items():
        print(f"\n{name}: not run ({reason})")


if __name__ == "__main__":
    main()
