# ruff: noqa: E402 - the number of threads is fixed before numpy is imported
"""What a study costs: `python -m benchmarks.study`.

1,000 runs of 5,000 evaluations on the array engine, with their curves and responses, against
pymoo's NSGA-II by `minimize`, which computes neither, on the same problem: `pose_accuracy`, nine
variables, two objectives, two limits. Both take turns in this one process, CPU time; a sample of
the runs is measured and scaled. Then what handing out runs of 0.1 s costs in CPU time of all
processes, in workers that a smaller study has started.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import pickle
import re
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import active_children
from pathlib import Path
from statistics import median
from typing import Any

from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.optimize import minimize

from tolevo.commands.study.configuration import read_study
from tolevo.commands.study.plan import StudyPlan, Yardstick, yardstick
from tolevo.commands.study.storage import Database, Site
from tolevo.commands.study.study import Work
from tolevo.execution import Executor, InProcess, executor_of

RUN = Path(__file__).resolve().parent.parent / "configs" / "pose_accuracy.toml"
STUDY = f"""
run = "{RUN}"
seeds = 1
response = ["hypervolume_ratio", "evaluations_to_99"]
"run.algorithm.name" = "nsga2"
"run.algorithm.engine" = "array"
"run.algorithm.population" = 100
"run.algorithm.evaluations" = 5000
[design]
kind = "one_at_a_time"
[vary]
"algorithm.mutation.eta" = [15.0, 20.0]
"""
PROMISED, RUNS = 10.0, 1000
ROUNDS, EACH = 10, 10
"""Rounds, and runs of the array engine in each, beside one of pymoo."""
LONG = "run.algorithm.evaluations=24000"
"""Runs of about 0.1 s."""
IDLE = 10.0
"""Seconds in which the processes that wait for work are watched."""
WARM, SEEDS = 4, 100
"""Seeds of the study that starts the workers, and of that which is measured."""


def planned(folder: Path, *changes: str) -> StudyPlan:
    path = folder / "study.toml"
    path.write_text(STUDY, encoding="utf-8")
    return read_study(path, changes)


def against_pymoo(folder: Path) -> None:
    """CPU of the runs of a study, database included, and of pymoo's own."""
    plan = planned(folder, f"seeds={EACH // 2}", "run.algorithm.generations=1000")
    problem = plan.problems[0]
    own, other = list[float](), list[float]()
    for number in range(ROUNDS):
        start = time.process_time()
        minimize(problem, NSGA2(pop_size=100), ("n_eval", 5000), seed=number)
        other.append(time.process_time() - start)
        own.append(round_of(plan, folder / str(number)) / plan.total)
    ratio = median(other) / median(own)
    print(f"{RUNS} runs of 5,000 evaluations: array engine in a study {RUNS * median(own):.1f} s "
          f"CPU, pymoo's NSGA-II {RUNS * median(other):.0f} s (measured: {ROUNDS * plan.total} and "
          f"{ROUNDS} runs, medians of {ROUNDS} rounds scaled): ratio {ratio:.1f}, promised "
          f"{PROMISED:.0f}")  # fmt: skip


def round_of(plan: StudyPlan, folder: Path) -> float:
    """CPU time of all runs of a plan, without that of the exact front, which is found once."""
    folder.mkdir()
    with Database(Site(folder).backend(), len(plan.points), plan.settings.responses) as database:
        keep_yardsticks(database, plan)
        work = Work(plan, database, InProcess(), None)
        start = time.process_time()
        work.finish()
        return time.process_time() - start


def handing_out(name: str, folder: Path, make: Callable[[], Executor], cpu: Callable[[], float],
                ) -> None:  # fmt: skip
    """CPU time of everything but the runs, as a share of that of the runs.

    What processes use that wait for work is told apart: it goes with the time, not with the runs.
    """
    with make() as executor:
        measured(folder / f"{name} warm", WARM, executor, cpu)
        start = cpu()
        time.sleep(IDLE)
        waiting = (cpu() - start) / IDLE
        count, own, total, seconds = measured(folder / name, SEEDS, executor, cpu)
    extra = total - own - waiting * seconds
    print(f"{name}: {count:.0f} runs of {own / count:.3f} s; handing out "
          f"{1e3 * extra / count:.2f} ms CPU a run, {100.0 * extra / own:.1f} % (promised: under "
          f"5 %); waiting {waiting:.3f} s CPU per second, here "
          f"{100.0 * waiting * seconds / own:.1f} %; load {os.getloadavg()[0]:.1f}")  # fmt: skip


def measured(out: Path, seeds: int, executor: Executor, cpu: Callable[[], float]) -> tuple[float, float, float, float]:
    """Runs of a study whose references are known, their CPU time, that of everything, and the
    wall time.
    """
    plan = planned(out.parent, f"seeds={seeds}", LONG)
    out.mkdir()
    with Database(Site(out).backend(), len(plan.points), plan.settings.responses) as database:
        keep_yardsticks(database, plan)
        work = Work(plan, database, executor, None)
        start, clock = cpu(), time.monotonic()
        work.finish()
        total, seconds = cpu() - start, time.monotonic() - clock
        runs = database.runs(plan.total)
    return len(runs), sum(run.cpu_s for run in runs), total, seconds


def keep_yardsticks(database: Database, plan: StudyPlan) -> None:
    """Put the references of a plan's problems into a database; each is measured once."""
    for number, problem in enumerate(plan.problems):
        content = pickle.dumps(problem)
        if content not in KNOWN:
            KNOWN[content] = yardstick(problem)
        database.keep_yardstick(number, KNOWN[content])


KNOWN: dict[bytes, Yardstick] = {}
"""References by what they belong to."""


def own_cpu() -> float:
    """CPU time of this process and of its workers, those that have ended included."""
    usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    own = sum(one.ru_utime + one.ru_stime for one in usage)
    return own + cpu_of([one.pid for one in active_children() if one.pid is not None])


def cpu_of(pids: list[int]) -> float:
    """CPU time of other processes so far."""
    total = 0
    for pid in pids:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        total += int(fields[11]) + int(fields[12])
    return total / os.sysconf("SC_CLK_TCK")


@contextmanager
def cluster() -> Iterator[tuple[str, list[int]]]:
    """A Dask scheduler and two workers on the loopback: address and process numbers."""
    bound = ["--host", "127.0.0.1", "--dashboard-address", "127.0.0.1:0"]
    dask, quiet = [sys.executable, "-m", "dask"], subprocess.DEVNULL
    os.environ["DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED"] = "False"  # as docs/study.md has it
    started: list[subprocess.Popen[Any]] = []
    try:
        scheduler = subprocess.Popen([*dask, "scheduler", "--port", "0", *bound], stderr=subprocess.PIPE, text=True)
        started.append(scheduler)
        assert scheduler.stderr is not None
        lines = (re.search(r"Scheduler at:\s+(tcp://\S+)", line) for line in scheduler.stderr)
        address = next(found[1] for found in lines if found)
        threading.Thread(target=scheduler.stderr.read, daemon=True).start()
        words = [*dask, "worker", address, *bound, "--nthreads", "1", "--no-nanny"]
        started += [subprocess.Popen(words, stdout=quiet, stderr=quiet) for _ in range(2)]
        yield address, [one.pid for one in started]
    finally:
        for process in started:
            process.kill()
            process.wait()


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        against_pymoo(folder)
        handing_out("in process", folder, lambda: executor_of(1), own_cpu)
        handing_out("2 processes", folder, lambda: executor_of(2), own_cpu)
        with cluster() as (address, pids):
            handing_out("2 Dask workers", folder, lambda: executor_of(0, address),
                        lambda: own_cpu() + cpu_of(pids))  # fmt: skip


if __name__ == "__main__":
    main()
