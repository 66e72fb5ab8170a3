"""Long and large work: CPU time and memory of each part, `python -m benchmarks.sizes [PART ...]`.

`store`: a study of 100,000 results that its own writer wrote, of invented runs, and its page.
`runs`: memory that 2,000 real runs in one process add after the first 200. `front`: the page of a
front of 20,000 points. `units`: `simulate` of 10^7 units. Every part has a process of its own.
"""

from __future__ import annotations

import gc
import multiprocessing
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd
from typer.testing import CliRunner

from tolevo.algorithms.archive import CURVE
from tolevo.algorithms.nsga2 import NSGA2
from tolevo.cli import app
from tolevo.commands.study.configuration import read_study
from tolevo.commands.study.study import study
from tolevo.commands.study.trial import Chunk, Job, RunRecord
from tolevo.execution import InProcess, Lost, Result, TaskT

STACK = """
problem = "stack"
seed = 1
references = "none"
[requirement]
name = "gap"
unit = "mm"
[[part]]
name = "a"
nominal = 20.0
unit = "mm"
sensitivity = 1.0
t_min = 0.01
t_max = 0.25
cost = { model = "reciprocal", a = 1.0, b = 0.75 }
[[part]]
name = "b"
nominal = 30.0
unit = "mm"
sensitivity = -2.0
t_min = 0.01
t_max = 0.25
cost = { model = "reciprocal", a = 1.0, b = 0.2 }
[algorithm]
"""
STUDY = """
run = "run.toml"
seeds = {seeds}
response = ["hypervolume"]
[design]
kind = "factorial"
[vary]
"algorithm.population" = {populations}
"""


class Invented(InProcess):
    """Hands back results without any run: what is measured is the study around them."""

    def completed(
        self, function: Callable[[TaskT], Result], source: Callable[[], TaskT | None]
    ) -> Iterator[tuple[TaskT, Result | Lost]]:
        while (task := source()) is not None:
            if isinstance(task, Chunk):
                yield task, tuple(_invented(job) for job in task.jobs)  # type: ignore[misc]
            else:
                yield task, function(task)


def _invented(job: Job) -> RunRecord:
    rng = np.random.default_rng(job.seed)
    population = cast(NSGA2, job.algorithm).population
    value = float(0.7 + 0.01 * population / 100 + rng.normal(0.0, 0.01))
    curve = np.zeros((20, len(CURVE)))
    curve[:, 0] = np.arange(20)
    curve[:, CURVE.index("value")] = np.sort(rng.uniform(0.0, value, 20))
    return RunRecord(job.point, job.replicate, job.seed, "done", "", 100, 0.01, {"hypervolume": value}, curve)


def store(folder: Path) -> None:
    """100,000 results: 20 settings by 5,000 seeds."""
    (folder / "run.toml").write_text(STACK + 'name = "random"\npopulation = 4\ngenerations = 1\n')
    text = STUDY.format(seeds=5000, populations=list(range(10, 30)))
    (folder / "study.toml").write_text(text)
    plan = read_study(folder / "study.toml")
    timed("100,000 results written, and all tables", lambda: study(plan, folder / "o", Invented()))
    timed("their page", lambda: command("report", folder / "o"))


def runs(folder: Path) -> None:
    """2,000 real runs in this process."""
    (folder / "run.toml").write_text(STACK + 'name = "nsga2"\npopulation = 8\ngenerations = 3\n')

    def some(seeds: int, name: str) -> float:
        (folder / "study.toml").write_text(STUDY.format(seeds=seeds, populations=[8, 10]))
        study(read_study(folder / "study.toml"), folder / name, InProcess())
        gc.collect()
        return rss()

    first = some(100, "a")
    timed("2,000 runs", lambda: some(1000, "b"))
    print(f"memory after 200 runs {first:.0f} MiB, after 2,000 more {rss():.0f} MiB")


def front(folder: Path) -> None:
    """The page of 20,000 points."""
    text = STACK + 'name = "exact"\npoints = 20000\n'
    (folder / "run.toml").write_text(text)
    words = ("run", folder / "run.toml", "--out", folder / "o", "--quiet", "--workers", 1,
             "--force")  # fmt: skip
    timed("a run of 20,000 exact points", lambda: command(*words))
    print(f"{len(pd.read_csv(folder / 'o' / 'front.csv'))} points")
    timed("its page", lambda: command("report", folder / "o"))
    print(f"page {(folder / 'o' / 'report.html').stat().st_size / 2**20:.2f} MiB")


def units(folder: Path) -> None:
    """10^7 units of a batch, in blocks."""
    (folder / "c.toml").write_text('model = "rv_batch"\nseed = 1\n')
    place = folder / "units.parquet"
    pd.DataFrame({"unit": np.arange(10**7)}).to_parquet(place)
    words = ("simulate", folder / "c.toml", place, "--out", folder / "o.parquet", "--quiet",
             "--force")  # fmt: skip
    timed("10^7 units", lambda: command(*words))


PARTS: dict[str, Callable[[Path], None]] = {
    "store": store, "runs": runs, "front": front, "units": units,
}  # fmt: skip


def command(*words: object) -> None:
    """A command in this process."""
    ended = CliRunner().invoke(app, [str(word) for word in words])
    if ended.exit_code:
        sys.exit(ended.output)


def rss() -> float:
    """Memory of this process now [MiB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 2**20


def timed(what: str, action: Callable[[], object]) -> None:
    """Say how much CPU time and memory something took."""
    start = time.process_time()
    action()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{what}: {time.process_time() - start:.2f} s, peak {peak:.0f} MiB", flush=True)


def part(name: str) -> None:
    """One part in a folder that goes afterwards."""
    with tempfile.TemporaryDirectory() as folder:
        PARTS[name](Path(folder))


if __name__ == "__main__":
    for one in sys.argv[1:] or PARTS:
        process = multiprocessing.get_context("spawn").Process(target=part, args=(one,))
        process.start()
        process.join()
