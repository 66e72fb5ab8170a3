"""What dies in the middle of a study or of an evaluation: no result is lost or doubled.

Workers are killed at twenty moments, the Dask scheduler at ten, in either. The
moments are shares of the work, so that all of them fall into its middle whatever else the machine
does.
"""

from __future__ import annotations

import os
import random
import signal
import sqlite3
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tolevo
from tests.dask_daemons import cluster, worker
from tolevo.commands.evaluate import GRAIN
from tolevo.commands.study.configuration import read_study
from tolevo.commands.study.storage import DATABASE
from tolevo.commands.study.study import study
from tolevo.commands.study.study import study as write
from tolevo.errors import RunError
from tolevo.execution import executor_of
from tolevo.problems.tolerance_problem import designs_frame

pytestmark = pytest.mark.slow

STUDY: dict[str, Any] = {
    "seeds": 40,
    "design": {"kind": "factorial"},
    "vary": {"algorithm.population": [8, 10, 12], "algorithm.mutation.probability": [0.05, 0.1]},
    "run": {
        "problem": "pose_accuracy",
        "parameters": {"index": "rms_plane"},
        "objectives": {"minimise": ["cost"]},
        "limits": {"squareness_mrad": 0.6, "yaw_mrad": 0.6},
        "algorithm": {"name": "ga", "population": 10, "generations": 60},
    },
}
"""240 runs of some 0.1 s."""
DESIGNS: dict[str, Any] = {"problem": "rv_backlash", "parameters": {"reading": "printed"}}
BLOCKS = 60


class Work(ABC):
    """Something that is computed in parts: `total` of them, of which the result is `whole`."""

    total: int
    whole: bytes

    @abstractmethod
    def do(self, out: Path, report: Any = None, resume: bool = False, **where: Any) -> None:
        """Compute what is missing, `where` somebody says."""

    @abstractmethod
    def result(self, out: Path) -> bytes:
        """The table."""

    def sound(self, out: Path) -> None:
        assert self.result(out) == self.whole


class Studied(Work):
    def __init__(self, folder: Path) -> None:
        self.plan = read_study(STUDY)
        self.total = self.plan.total
        self.do(folder)
        self.whole = self.result(folder)

    def do(self, out: Path, report: Any = None, resume: bool = False, **where: Any) -> None:
        executor = executor_of(where.get("workers", 1), where.get("dask", ""))
        study(self.plan, out, executor, report, resume)

    def result(self, out: Path) -> bytes:
        return (out / "study.csv").read_bytes()

    def sound(self, out: Path) -> None:
        super().sound(out)
        connection = sqlite3.connect(out / DATABASE)
        rows = connection.execute("SELECT point, replicate FROM runs").fetchall()
        connection.close()
        assert len(rows) == len(set(rows)) == self.total


class Evaluated(Work):
    def __init__(self, folder: Path) -> None:
        self.total, self.designs = BLOCKS, folder / "designs.parquet"
        problem = tolevo.read(DESIGNS).problem
        assert problem is not None
        share = np.random.default_rng(0).random((BLOCKS * GRAIN - 7, problem.n_var))
        full = problem.complete(problem.xl + share * (problem.xu - problem.xl))
        designs_frame(problem, full).to_parquet(self.designs, index=False)
        self.do(folder / "whole")
        self.whole = self.result(folder / "whole")

    def do(self, out: Path, report: Any = None, resume: bool = False, **where: Any) -> None:
        tolevo.evaluate(DESIGNS, self.designs, out.with_suffix(".csv"), block_rows=GRAIN,
                        frame=False, progress=report, resume=resume, **where)  # fmt: skip

    def result(self, out: Path) -> bytes:
        return out.with_suffix(".csv").read_bytes()


@pytest.fixture(scope="module", params=[Studied, Evaluated])
def work(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(write, "figures", lambda result: ())  # most of the time of a short study
        yield request.param(tmp_path_factory.mktemp("whole"))


def moments(count: int) -> list[float]:
    """Shares of the work, one in each of `count` equal parts of it."""
    rng = random.Random(count)
    return [0.92 * (at + rng.random()) / count for at in range(count)]


class Striking:
    """A report of progress that calls `strike` when the shares of the work are done."""

    def __init__(self, strike: Callable[[], None], shares: list[float]) -> None:
        self.strike, self.residual_forms, self.struck = strike, list(shares), list[int]()

    def __call__(self, state: Any) -> None:
        if self.residual_forms and state.done > self.residual_forms[0] * state.total:
            self.residual_forms.pop(0)
            self.struck.append(state.done)
            self.strike()


def test_processes_are_killed_at_twenty_moments(work: Work, tmp_path: Path) -> None:
    def strike() -> None:
        os.kill(eldest(), signal.SIGKILL)

    striking = Striking(strike, moments(20))
    work.do(tmp_path / "out", striking, workers=2)
    assert len(striking.struck) == 20
    work.sound(tmp_path / "out")


def eldest() -> int:
    """The worker of this process that was started first: it is at work, not being started."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
            if int(fields[1]) == os.getpid() and b"spawn_main" in (path.parent / "cmdline").read_bytes():
                found.append((int(fields[19]), int(path.parent.name)))
        except OSError:
            continue
    return min(found)[1]


def test_dask_workers_are_killed_at_twenty_moments(work: Work, tmp_path: Path) -> None:
    """Whoever is killed is followed by another."""
    with cluster() as (_, address, workers):

        def strike() -> None:
            workers[len(striking.struck) - 1].kill()
            workers.append(worker(address))

        striking = Striking(strike, moments(20))
        work.do(tmp_path / "out", striking, dask=address)
    assert len(striking.struck) == 20
    work.sound(tmp_path / "out")


def test_the_scheduler_is_killed_at_ten_moments(work: Work, tmp_path: Path) -> None:
    """Each time the command ends, says what is saved, and goes on with another scheduler."""
    for share in moments(10):
        with cluster() as (process, address, _):
            striking = Striking(process.kill, [share])
            with pytest.raises(RunError, match=r"scheduler .* was lost.*saved.*--resume"):
                work.do(tmp_path / "out", striking, resume=True, dask=address)
        assert len(striking.struck) == 1
    work.do(tmp_path / "out", resume=True)
    work.sound(tmp_path / "out")
