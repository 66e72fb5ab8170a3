"""The same study wherever it runs and whatever dies meanwhile: the same study.csv to the byte."""

from __future__ import annotations

import multiprocessing
import multiprocessing.context
import operator
import os
import random
import signal
import socket
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from tests.dask_daemons import LOOPBACK, cluster, wait_until
from tests.small_jobs import POSE_BY_GA
from tolevo import dask_cluster
from tolevo.cli import app
from tolevo.commands.study.configuration import read_study
from tolevo.commands.study.plan import StudyPlan, StudyProgress
from tolevo.commands.study.storage import DATABASE
from tolevo.commands.study.study import study
from tolevo.commands.study.trial import Chunk
from tolevo.errors import InputError, RunError
from tolevo.execution import InProcess, Lost, Processes, Result, TaskT, executor_of

pytestmark = [pytest.mark.long, pytest.mark.usefixtures("unrendered")]

RUN = POSE_BY_GA.format(mrad=0.6, more="yaw_mrad = 0.6", population=10, generations=8)
STUDY = """
run = "run.toml"
seeds = 8
response = ["gap_percent", "feasible_fraction"]
[design]
kind = "factorial"
[vary]
"algorithm.population" = [8, 10, 12]
"algorithm.mutation.probability" = [0.05, 0.1]
"""
TRIALS = int(os.environ.get("TOLEVO_TRIALS", "4"))
"""Kills of a study at random moments."""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    (folder / "run.toml").write_text(RUN, encoding="utf-8")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    return folder / "study.toml"


@pytest.fixture(scope="module")
def plan(config: Path) -> StudyPlan:
    return read_study(config)


@pytest.fixture(scope="module")
def table(plan: StudyPlan, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """study.csv of one unbroken study in this process."""
    out = tmp_path_factory.mktemp("reference")
    study(plan, out, InProcess())
    content = (out / "study.csv").read_bytes()
    assert content.count(b"\n") == plan.total + 1
    return content


def sound(out: Path, plan: StudyPlan, table: bytes) -> None:
    """The same table, every run once in the database."""
    assert (out / "study.csv").read_bytes() == table
    connection = sqlite3.connect(out / DATABASE)
    try:
        rows = connection.execute("SELECT point, replicate FROM runs").fetchall()
    finally:
        connection.close()
    assert len(rows) == len(set(rows)) == plan.total


def ended(out: Path) -> int:
    """Runs in the database of a study that may be under way."""
    if not (out / DATABASE).exists():
        return 0
    connection = sqlite3.connect(out / DATABASE, timeout=10.0)
    try:
        return int(connection.execute("SELECT COUNT(*) FROM runs").fetchone()[0])
    except sqlite3.OperationalError:
        return 0
    finally:
        connection.close()


def children() -> set[int]:
    """Python processes whose parent is this one, by /proc."""
    found = set()
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == os.getpid():
            found.add(int(path.parent.name))
    return found


def test_two_workers_one_killed_in_the_middle(plan: StudyPlan, table: bytes, tmp_path: Path) -> None:
    """SIGKILL to one of the two processes once runs have come back from them."""
    before, killed = children(), list[int]()

    def report(state: StudyProgress) -> None:
        workers = [pid for pid in children() - before if b"spawn_main" in cmdline(pid)]
        if state.done and not killed and len(workers) == 2:
            killed.append(workers[0])
            os.kill(workers[0], signal.SIGKILL)

    assert study(plan, tmp_path, Processes(2), report).status == "done"
    assert len(killed) == 1
    sound(tmp_path, plan, table)
    assert not any(b"spawn_main" in cmdline(pid) for pid in children() - before)


def cmdline(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


@pytest.mark.slow
def test_killed_at_random_moments(plan: StudyPlan, table: bytes, tmp_path: Path) -> None:
    """The whole process by SIGKILL, resumed each time, and finished at last.

    A study that gets to its end in spite of them is looked at, and followed by another.
    """
    moments, out, counts = random.Random(7), tmp_path / "0", list[int]()
    start = time.monotonic()
    study(plan, tmp_path / "pace", InProcess())
    longest = 0.4 * (time.monotonic() - start)
    while len(counts) < TRIALS:
        process = server().Process(target=study, args=(plan, out, InProcess(), None, True))
        process.start()
        wait_until(partial(begun, process, out, ended(out)))
        time.sleep(moments.uniform(0.0, longest))
        process.kill()
        process.join()
        if process.exitcode == 0:
            sound(out, plan, table)
            out = tmp_path / str(len(counts))
        else:
            assert process.exitcode == -signal.SIGKILL
            counts.append(ended(out))
    assert any(0 < count < plan.total for count in counts)
    assert study(plan, out, InProcess(), resume=True).status == "done"
    sound(out, plan, table)


def begun(process: BaseProcess, out: Path, before: int) -> bool:
    """Whether a process works on the study in `out`, or is through with it."""
    return not process.is_alive() or ended(out) > before


def server() -> multiprocessing.context.ForkServerContext:
    """Processes that have everything imported when they begin."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tolevo.commands.study.study", "tolevo.commands.run.run",
                                    "tolevo.problems.pose_accuracy", "tolevo.algorithms.ga",
                                    "pymoo.algorithms.soo.nonconvex.ga"])  # fmt: skip
    return context


def test_a_second_process_is_refused_and_changes_nothing(
    config: Path, plan: StudyPlan, table: bytes, tmp_path: Path
) -> None:
    """A directory has one owner: a second command says who it is, and the first one goes on."""
    second: list[Any] = []

    def report(state: StudyProgress) -> None:
        if state.done and not second:
            words = [sys.executable, "-m", "tolevo", "study", config, "--out", tmp_path, "--quiet", "--resume"]
            second.append(subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False))

    assert study(plan, tmp_path, InProcess(), report).status == "done"
    assert second[0].returncode == 2
    assert f"--out: {tmp_path} is in use by `tolevo study` (process {os.getpid()} on" in second[0].stderr
    sound(tmp_path, plan, table)


@pytest.mark.slow
def test_a_killed_study_leaves_no_worker_behind(config: Path, plan: StudyPlan, table: bytes, tmp_path: Path) -> None:
    """`tolevo study --workers 2` by SIGKILL; its workers end too, and --resume finishes."""
    command = [sys.executable, "-m", "tolevo", "study", config, "--out", tmp_path, "--quiet",
               "--workers", 2, "--resume"]  # fmt: skip
    process = subprocess.Popen([str(word) for word in command])
    try:
        wait_until(lambda: ended(tmp_path) > 0)
        workers = [
            int(path.name)
            for path in Path("/proc").glob("[0-9]*")
            if b"spawn_main" in cmdline(int(path.name)) and parent_of(int(path.name)) == process.pid
        ]
        assert workers
    finally:
        process.kill()
        process.wait()
    result = CliRunner().invoke(app, ["study", str(config), "--out", str(tmp_path), "--resume",
                                      "--workers", "1", "--quiet"])  # fmt: skip
    assert result.exit_code == 0, result.output
    sound(tmp_path, plan, table)
    wait_until(lambda: not any(b"spawn_main" in cmdline(pid) for pid in workers))


def parent_of(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
    except OSError:
        return 0


def test_a_task_that_kills_every_process_is_given_up() -> None:
    """Its neighbours are not: three tasks, the second of which ends its process."""
    tasks: Any = iter([partial(os.getpid), partial(os._exit, 9), partial(os.getpid)])
    with Processes(2) as pool:
        found = list(pool.completed(operator.call, lambda: next(tasks, None)))
    lost = [result for _, result in found if isinstance(result, Lost)]
    assert len(lost) == 1
    assert "lost 3 times" in lost[0].reason
    assert len(found) == 3


class Losing(InProcess):
    """Loses every chunk that one certain run is in."""

    def completed(
        self, function: Callable[[TaskT], Result], source: Callable[[], TaskT | None]
    ) -> Iterator[tuple[TaskT, Result | Lost]]:
        while (task := source()) is not None:
            jobs = task.jobs if isinstance(task, Chunk) else ()
            fatal = any((job.point, job.replicate) == (2, 7) for job in jobs)
            yield task, Lost("its process was lost") if fatal else function(task)


def test_of_a_lost_chunk_only_the_guilty_run_has_failed(plan: StudyPlan, table: bytes, tmp_path: Path) -> None:
    study(plan, tmp_path, Losing())
    lines = zip((tmp_path / "study.csv").read_bytes().splitlines(), table.splitlines(), strict=True)
    other = [one for one, expected in lines if one != expected]
    assert len(other) == 1
    assert other[0].startswith(b"2,10,0.05,7,")
    assert other[0].endswith(b",failed,its process was lost,,")


def listening(pids: set[int]) -> set[str]:
    """Addresses (hexadecimal, as /proc has them) at which processes listen."""
    inodes = set()
    for pid in pids:
        for link in Path(f"/proc/{pid}/fd").iterdir():
            target = os.readlink(link)
            if target.startswith("socket:["):
                inodes.add(target[8:-1])
    found = set()
    for name in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{name}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and fields[9] in inodes:
                found.add(fields[1].rpartition(":")[0])
    return found


def test_dask_a_worker_killed_then_the_scheduler(plan: StudyPlan, table: bytes, tmp_path: Path) -> None:
    """Two workers, one killed in the middle; then a study whose scheduler is killed."""
    with cluster() as (process, address, workers):
        first = DaskKiller(lambda: workers[0].kill(), at=plan.total // 4)
        executor = executor_of(0, address)
        assert listening({process.pid, *(one.pid for one in workers)}) == {"0100007F"}
        assert study(plan, tmp_path / "a", executor, first).status == "done"
        assert first.struck
        sound(tmp_path / "a", plan, table)
        second = DaskKiller(process.kill, at=3)
        with pytest.raises(RunError, match=r"scheduler .* was lost.*runs have ended.*--resume"):
            study(plan, tmp_path / "b", executor_of(0, address), second)
    kept = ended(tmp_path / "b")
    assert 3 <= kept < plan.total
    assert study(plan, tmp_path / "b", InProcess(), resume=True).status == "done"
    sound(tmp_path / "b", plan, table)


class DaskKiller:
    """Kills something when `at` runs have ended."""

    def __init__(self, kill: Callable[[], None], at: int) -> None:
        self.kill = kill
        self.at = at
        self.struck = False

    def __call__(self, state: StudyProgress) -> None:
        if state.done >= self.at and not self.struck:
            self.struck = True
            self.kill()


def test_nobody_answers_within_ten_seconds(config: Path, tmp_path: Path) -> None:
    """Something takes the connection and says nothing."""
    out = tmp_path / "out"
    with socket.create_server((LOOPBACK, 0)) as silent:
        address = f"tcp://{LOOPBACK}:{silent.getsockname()[1]}"
        words = ["study", str(config), "--out", str(out), "--dask", address]
        start = time.monotonic()
        result = CliRunner().invoke(app, words)
    assert result.exit_code == 2
    assert result.stderr.startswith(f"--dask: no Dask scheduler answers at {address} (no answer)")
    assert time.monotonic() - start < 10.0 + 5.0  # to read the configuration as well
    assert not out.exists()


def test_a_port_where_nothing_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_cluster, "PATIENCE", 0.5)
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        executor_of(1, "tcp://127.0.0.1:9")


@pytest.mark.parametrize("address", ["nonsense", "tcp://", "udp://127.0.0.1:1", "tls://127.0.0.1:1"])
def test_an_address_that_is_none(address: str) -> None:
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        executor_of(1, address)
