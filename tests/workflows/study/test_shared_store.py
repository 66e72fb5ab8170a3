"""A study whose runs are in a PostgreSQL server: shared, refused, and what dies meanwhile."""

from __future__ import annotations

import multiprocessing
import os
import random
import re
import sqlite3
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from tests.postgres import Server, server
from tolevo.cli import app
from tolevo.commands.study.configuration import read_study
from tolevo.commands.study.plan import StudyPlan, StudyProgress
from tolevo.commands.study.storage import DATABASE, Database, Site
from tolevo.commands.study.study import study
from tolevo.commands.study.trial import Chunk
from tolevo.errors import RunError
from tolevo.execution import InProcess, Lost, Processes, TaskT
from tolevo.execution import Result as Done
from tolevo.store import store as store_module
from tolevo.store.tables import FORMAT

RUN = """
problem = "pose_accuracy"
[parameters]
index = "rms_plane"
[objectives]
minimise = ["cost"]
[limits]
squareness_mrad = 0.6
yaw_mrad = 0.6
[algorithm]
name = "ga"
population = 10
generations = 8
"""
STUDY = """
run = "run.toml"
seeds = 5
[design]
kind = "factorial"
[vary]
"algorithm.population" = [8, 10, 12]
"algorithm.mutation.probability" = [0.05, 0.1]
"""
LONG = ("seeds=40", "run.algorithm.generations=60")
"""A study of some ten seconds of CPU, so that much can be killed in it."""
LONGER = ("seeds=120", "run.algorithm.generations=60")
"""One that is not through before machines have been begun ten times."""
KILLS = int(os.environ.get("TOLEVO_TRIALS", "10"))
"""How often a machine is killed."""


pytestmark = pytest.mark.usefixtures("unrendered")


@pytest.fixture
def address(postgres: Server, schema: str) -> str:
    return postgres.store(schema)


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
def finished(plan: StudyPlan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The study in a file, by one process."""
    out = tmp_path_factory.mktemp("finished")
    study(plan, out, InProcess())
    return out


@pytest.fixture(scope="module")
def long(config: Path) -> StudyPlan:
    return read_study(config, LONG)


@pytest.fixture(scope="module")
def long_table(long: StudyPlan, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    out = tmp_path_factory.mktemp("long")
    study(long, out, Processes(2))
    return (out / "study.csv").read_bytes()


def command(config: Path, out: Path, *arguments: str) -> Result:
    words = ["study", str(config), "--out", str(out), "--quiet", "--workers", "1", *arguments]
    return CliRunner().invoke(app, words)


def sound(postgres: Server, schema: str, plan: StudyPlan) -> None:
    """Every run is there once, and no claim is left."""
    rows = postgres.ask(schema, "SELECT point, replicate FROM runs")
    assert len(rows) == len(set(rows)) == plan.total
    assert postgres.ask(schema, "SELECT * FROM claims") == []


def test_the_table_is_that_of_a_file_and_a_second_machine_finds_it_done(
    config: Path, finished: Path, postgres: Server, schema: str, tmp_path: Path
) -> None:
    address, plan = postgres.store(schema), read_study(config)
    table = (finished / "study.csv").read_bytes()
    first = command(config, tmp_path / "first", "--store", address)
    assert first.exit_code == 0, first.output
    second = command(config, tmp_path / "second", "--store", address)
    assert second.exit_code == 0, second.output
    for out in (tmp_path / "first", tmp_path / "second"):
        assert (out / "study.csv").read_bytes() == table
        assert not (out / DATABASE).exists()
        assert (out / "study.json").read_bytes() == (finished / "study.json").read_bytes()
    sound(postgres, schema, plan)
    assert postgres.ask(schema, "SELECT COUNT(*) FROM yardsticks") == [(len(plan.problems),)]


def test_a_configuration_may_name_it(config: Path, postgres: Server, schema: str, tmp_path: Path) -> None:
    setting = f'execution.store="{postgres.store(schema)}"'
    assert command(config, tmp_path / "out", "--set", setting).exit_code == 0
    assert "postgresql" not in (tmp_path / "out" / "config.toml").read_text()
    resumed = command(config, tmp_path / "out", "--resume")
    assert resumed.exit_code == 2
    assert f"--store: the runs of {tmp_path / 'out'} are in postgresql" in resumed.stderr
    assert command(config, tmp_path / "out", "--resume", "--set", setting).exit_code == 0


@pytest.mark.parametrize(
    ("address", "why"),
    [
        ("postgresql://me:secret@host/db", "has a password in it: take it out"),
        ("postgresql://host/db?password=secret", "has a password in it: take it out"),
        ("mysql://host/db", "must begin with postgresql://"),
        ("postgresql://host:port/db", "is not the address of a database"),
        ("postgresql://host/db?schema=A-b", 'schema must be small letters, digits and _, got "A-b"'),
        ("postgresql://127.0.0.1:1/db", "it cannot be reached (connection failed"),
    ],
)
def test_addresses_that_are_refused_with_all_that_is_wrong(
    config: Path, tmp_path: Path, address: str, why: str
) -> None:
    """Both ways to name it; the other faults are reported with it, and nothing is written."""
    for place, words in (
        ("--store", ("--store", address)),
        ("execution.store", ("--set", f'execution.store="{address}"')),
    ):
        found = command(config, tmp_path / "out", *words, "--set", "seeds=0",
                        "--set", "execution.block_rows=0")  # fmt: skip
        assert found.exit_code == 2
        lines = found.stderr.splitlines()
        assert any(line.startswith(f"{place}: ") and why in line for line in lines), found.stderr
        assert any(line.startswith("seeds: must be at least 1") for line in lines)
        assert any(line.startswith("execution.block_rows: must be at least 1") for line in lines)
        assert "secret" not in found.output
        assert not (tmp_path / "out").exists()


def test_a_newer_store_and_that_of_another_study_are_refused(
    config: Path, postgres: Server, schema: str, tmp_path: Path
) -> None:
    words = ("--store", postgres.store(schema))
    assert command(config, tmp_path / "out", *words).exit_code == 0
    before = postgres.ask(schema, "SELECT * FROM meta ORDER BY key")
    other = command(config, tmp_path / "a", *words, "--set", "run.algorithm.generations=13",
                    "--set", "seeds=3")  # fmt: skip
    assert other.exit_code == 2
    assert "belongs to another configuration: seeds is 3, but" in other.stderr
    assert "belongs to another configuration: run.algorithm.generations is 13" in other.stderr
    postgres.ask(schema, f"UPDATE meta SET value = '{FORMAT + 1}' WHERE key = 'format'")
    newer = command(config, tmp_path / "b", *words, "--set", "bogus=1")
    assert newer.exit_code == 2
    assert "bogus" in newer.stderr
    assert f"was written by a newer version of tolevo (format {FORMAT + 1}" in newer.stderr
    assert not (tmp_path / "a").exists()
    assert not (tmp_path / "b").exists()
    postgres.ask(schema, f"UPDATE meta SET value = '{FORMAT}' WHERE key = 'format'")
    assert postgres.ask(schema, "SELECT * FROM meta ORDER BY key") == before
    postgres.ask(schema, "DROP TABLE meta")
    foreign = command(config, tmp_path / "c", *words)
    assert foreign.exit_code == 2
    assert "is not the database of a study; name another schema" in foreign.stderr


def test_a_changed_row_is_done_again(
    config: Path, finished: Path, postgres: Server, schema: str, tmp_path: Path
) -> None:
    words = ("--store", postgres.store(schema))
    assert command(config, tmp_path, *words).exit_code == 0
    postgres.ask(schema, "UPDATE runs SET gap_percent = 0 WHERE point = 1 AND replicate = 3")
    again = command(config, tmp_path, *words, "--resume")
    assert "1 runs (point 1 replicate 3)" in again.output
    assert (tmp_path / "study.csv").read_bytes() == (finished / "study.csv").read_bytes()
    sound(postgres, schema, read_study(config))


def test_a_lease_is_renewed_taken_over_and_a_late_result_counts_once(
    plan: StudyPlan, finished: Path, address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the clock of the database: one machine stops renewing, another takes its runs over."""
    monkeypatch.setattr(store_module, "LEASE_S", 0.4)
    monkeypatch.setattr(store_module, "RENEWED_S", 0.1)
    made = partial(Database, points=len(plan.points), responses=plan.settings.responses)
    with made(Site(finished).backend()) as source:
        run = source.runs(plan.total)[0]
    with made(Site(Path(), address).backend()) as one, made(Site(Path(), address).backend()) as two:
        assert one.claim_runs([0, 1]) == [0, 1]
        assert two.claim_runs([0, 1, 2]) == [2]
        assert two.free([0, 1, 2, 3]) == [3]
        time.sleep(0.8)  # longer than a lease, but it was renewed
        assert two.claim_runs([0, 1]) == []
        assert one._renewal is not None
        one._ended.set()  # its machine is gone
        one._renewal.join()
        time.sleep(0.5)
        assert two.claim_runs([0]) == [0]
        assert one.record([run]) == 1  # it was not gone, only late
        assert two.record([run]) == 0
        assert one.count(plan.total) == (1, 0)
        assert two.claim_runs([0]) == []
        assert len(one.runs(plan.total)) == 1


def test_a_time_that_nobody_may_claim_does_not_count(plan: StudyPlan, tmp_path: Path) -> None:
    with Database(Site(tmp_path).backend(), len(plan.points), ()) as one:
        connection = sqlite3.connect(tmp_path / DATABASE)
        connection.execute("INSERT INTO claims VALUES (0, 'x', 9e999), (1, 'y', 0.0)")
        connection.commit()
        connection.close()
        assert one.claim_runs([0, 1]) == [0, 1]


# ---------------------------------------------------------------- what dies


class Counting(Processes):
    """Writes the runs that it hands out to a file, to be counted over all machines."""

    def __init__(self, workers: int, path: Path) -> None:
        super().__init__(workers)
        self.path = path

    def completed(
        self, function: Callable[[TaskT], Done], source: Callable[[], TaskT | None]
    ) -> Iterator[tuple[TaskT, Done | Lost]]:
        def noted() -> TaskT | None:
            task = source()
            if isinstance(task, Chunk):
                with self.path.open("a", encoding="utf-8") as file:
                    for job in task.jobs:
                        file.write(f"{job.point} {job.replicate}\n")
            return task

        return super().completed(function, noted)


def machine(plan: StudyPlan, out: Path, address: str, handed: Path, resume: bool) -> None:
    """A machine with two workers."""
    study(plan, out, Counting(2, handed), None, resume, store=address)


def begun(plan: StudyPlan, out: Path, address: str, resume: bool = False) -> Any:
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__])
    process = context.Process(target=machine, args=(plan, out, address, out.with_suffix(".txt"),
                                                    resume))  # fmt: skip
    process.start()
    return process


def wait_until(condition: Callable[[], bool], seconds: float = 600.0) -> None:
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, "took too long"
        time.sleep(0.02)


def counted(postgres: Server, schema: str) -> int:
    found = postgres.ask("public", f"SELECT to_regclass('{schema}.runs')")
    return int(postgres.ask(schema, "SELECT COUNT(*) FROM runs")[0][0]) if found[0][0] else 0


def reached(postgres: Server, schema: str, count: float) -> bool:
    return counted(postgres, schema) >= count


def at_work(process: Any) -> bool:
    """Whether a machine has its two workers, or is through."""
    return len(workers(process.pid)) == 2 or not process.is_alive()


def killed_server(postgres: Server, schema: str, plan: StudyPlan, table: bytes, folder: Path, moments: int) -> None:
    """The server killed and started again so often while two workers write into it."""
    shares = sorted(random.Random(3).uniform(0.02, 0.9) for _ in range(moments))
    address, struck = postgres.store(schema), list[int]()

    def report(state: StudyProgress) -> None:
        if len(struck) < moments and state.done >= shares[len(struck)] * plan.total:
            struck.append(state.done)
            postgres.kill()
            postgres.start()

    outcome = study(plan, folder, Processes(2), report, store=address)
    assert outcome.status == "done"
    assert len(struck) == moments
    assert (folder / "study.csv").read_bytes() == table
    sound(postgres, schema, plan)


def test_the_server_is_killed(plan: StudyPlan, finished: Path, postgres: Server, schema: str, tmp_path: Path) -> None:
    table = (finished / "study.csv").read_bytes()
    killed_server(postgres, schema, plan, table, tmp_path / "out", 1)


@pytest.mark.slow
def test_the_server_is_killed_at_ten_moments(
    long: StudyPlan, long_table: bytes, postgres: Server, schema: str, tmp_path: Path
) -> None:
    """Two machines of two workers each, and what kills the server looks at how far they are."""
    address, rng = postgres.store(schema), random.Random(3)
    both = [begun(long, tmp_path / name, address) for name in ("a", "b")]
    for share in sorted(rng.uniform(0.02, 0.9) for _ in range(10)):
        wait_until(partial(reached, postgres, schema, share * long.total))
        postgres.kill()
        time.sleep(rng.uniform(0.0, 1.0))
        postgres.start()
    for one in both:
        one.join()
        assert one.exitcode == 0
    for name in ("a", "b"):
        assert (tmp_path / name / "study.csv").read_bytes() == long_table
    sound(postgres, schema, long)


@pytest.mark.slow
def test_two_machines_do_no_run_twice_and_wait_for_no_lock(
    long: StudyPlan, long_table: bytes, postgres: Server, schema: str, tmp_path: Path
) -> None:
    logged = postgres.log.stat().st_size
    both = [begun(long, tmp_path / name, postgres.store(schema)) for name in ("a", "b")]
    for one in both:
        one.join()
        assert one.exitcode == 0
    handed = [(tmp_path / f"{name}.txt").read_text().splitlines() for name in ("a", "b")]
    assert all(handed), "one of them did nothing"
    assert len(handed[0] + handed[1]) == len({*handed[0], *handed[1]}) == long.total
    for name in ("a", "b"):
        assert (tmp_path / name / "study.csv").read_bytes() == long_table
    sound(postgres, schema, long)
    log = postgres.log.read_bytes()[logged:].decode()
    waits = [float(ms) for ms in re.findall(r"acquired \w+ on .* after ([\d.]+) ms", log)]
    print(f"lock waits over 0.1 s: {len(waits)}, longest {max(waits, default=0.0):.0f} ms; "
          f"runs {len(handed[0])} and {len(handed[1])}")  # fmt: skip
    assert max(waits, default=0.0) < 5000.0


@pytest.mark.slow
def test_machines_are_killed_at_ten_moments(config: Path, postgres: Server, schema: str, tmp_path: Path) -> None:
    """Two machines of two workers each; now one is killed and begun again, now the other.

    A machine that begins again drops the claims that were made from its directory, so that nobody
    waits for a lease. What is killed is the machine alone: its workers find that out themselves.
    """
    plan, address, rng = read_study(config, LONGER), postgres.store(schema), random.Random(5)
    study(plan, tmp_path / "whole", Processes(2))
    outs = [tmp_path / name for name in ("a", "b")]
    both, struck = [begun(plan, out, address) for out in outs], list[int]()
    for moment in range(KILLS):
        at = moment % 2
        share = 0.9 * (moment + rng.random()) / KILLS
        wait_until(partial(reached, postgres, schema, share * plan.total))
        wait_until(partial(at_work, both[at]))
        orphans = workers(both[at].pid)
        both[at].kill()
        both[at].join()
        struck.append(counted(postgres, schema))
        wait_until(partial(all_gone, orphans))
        both[at] = begun(plan, outs[at], address, resume=True)
    for one, out in zip(both, outs, strict=True):
        one.join()
        assert one.exitcode == 0
        assert (out / "study.csv").read_bytes() == (tmp_path / "whole" / "study.csv").read_bytes()
    sound(postgres, schema, plan)
    print(f"machines were killed when {struck} of {plan.total} runs had ended")
    assert sum(0 < at < plan.total for at in struck) >= KILLS - 2


def all_gone(pids: list[int]) -> bool:
    """Whether none of these processes is there any more."""
    return not any(Path(f"/proc/{pid}").exists() for pid in pids)


def workers(pid: int) -> list[int]:
    """Worker processes of a machine."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(path.read_text().rpartition(")")[2].split()[1])
            if parent == pid and b"spawn_main" in (path.parent / "cmdline").read_bytes():
                found.append(int(path.parent.name))
        except OSError:
            continue
    return found


def test_a_server_that_is_gone_for_good_ends_the_study(
    plan: StudyPlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store_module, "PATIENCE_S", 0.2)
    with server() as own:

        def report(state: StudyProgress) -> None:
            if state.done >= 3:
                own.kill()

        with pytest.raises(RunError, match=r"cannot be reached.*runs? .*--resume"):
            study(plan, tmp_path / "out", InProcess(), report, store=own.store("s"))
        own.start()
        kept = counted(own, "s")
        assert kept >= 3
        outcome = study(plan, tmp_path / "out", InProcess(), resume=True, store=own.store("s"))
        assert outcome.status == "done"
        sound(own, "s", plan)
