"""A table whose blocks are in a PostgreSQL server: the same bytes, nothing twice, refused."""

from __future__ import annotations

import multiprocessing
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tolevo
from tests.postgres import Server
from tolevo import blocks as compute
from tolevo.commands.evaluate import GRAIN
from tolevo.errors import InputError
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.tolerance_problem import designs_frame
from tolevo.store import store as store_module

CONFIGURATION: dict[str, Any] = {"problem": "rv_backlash", "parameters": {"reading": "printed"}}
BLOCKS = 6


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return designs(tmp_path_factory.mktemp("designs") / "designs.csv", BLOCKS)


def designs(path: Path, blocks: int) -> Path:
    """A table of so many blocks, the last of which is not full."""
    problem = RvBacklash()
    share = np.random.default_rng(1).random((blocks * GRAIN - 5, problem.n_var))
    full = problem.complete(problem.xl + share * (problem.xu - problem.xl))
    designs_frame(problem, full).to_csv(path, index=False)
    return path


@pytest.fixture(scope="module")
def whole(table: Path) -> bytes:
    tolevo.evaluate(CONFIGURATION, table, table.with_name("whole.csv"))
    return table.with_name("whole.csv").read_bytes()


def evaluated(table: Path, out: Path, store: str, **more: Any) -> None:
    tolevo.evaluate(CONFIGURATION, table, out, store=store, block_rows=GRAIN, frame=False, **more)


def sound(postgres: Server, schema: str, blocks: int = BLOCKS) -> None:
    assert postgres.ask(schema, "SELECT COUNT(*), COUNT(DISTINCT number) FROM blocks") == [(blocks, blocks)]
    assert postgres.ask(schema, "SELECT * FROM claims") == []


def test_the_bytes_are_those_of_one_process_and_nothing_is_computed_twice(
    table: Path, whole: bytes, postgres: Server, schema: str, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """The server is killed on the way; then another machine finds all of it, one block damaged."""
    store, done = postgres.store(schema), list[int]()
    performed = compute.perform

    def counted(task: Any) -> bytes:
        done.append(task.number)
        return performed(task)

    def report(state: Any) -> None:
        if state.done == BLOCKS // 2:
            postgres.kill()
            postgres.start()

    monkeypatch.setattr(compute, "perform", counted)
    evaluated(table, tmp_path / "a.csv", store, progress=report)
    assert (tmp_path / "a.csv").read_bytes() == whole
    assert sorted(done) == list(range(BLOCKS))
    sound(postgres, schema)
    postgres.ask(schema, "UPDATE blocks SET content = substr(content, 2) WHERE number = 3")
    done.clear()
    evaluated(table, tmp_path / "b.csv", store)
    assert done == [3]
    assert (tmp_path / "b.csv").read_bytes() == whole
    evaluated(table, tmp_path / "parts", store, partitioned=True)
    assert len(list((tmp_path / "parts").glob("part-*.parquet"))) == BLOCKS
    sound(postgres, schema)


def test_a_store_of_something_else_is_refused(table: Path, postgres: Server, schema: str, tmp_path: Path) -> None:
    store = postgres.store(schema)
    evaluated(table, tmp_path / "a.csv", store)
    with pytest.raises(InputError) as caught:
        tolevo.evaluate(CONFIGURATION, table, tmp_path / "b.csv", store=store, quality="search",
                        settings=["seed=3"])  # fmt: skip
    places = [fault.place for fault in caught.value.faults]
    assert places == ["--store"] * 2
    assert "belongs to another configuration; name another schema" in str(caught.value)
    assert "belongs to another quality" in str(caught.value)
    assert not (tmp_path / "b.csv").exists()
    run = {"problem": "pose_accuracy", "algorithm": {"name": "nsga2"}}
    study = {"seeds": 2, "run": run, "design": {"kind": "factorial"},
             "vary": {"algorithm.population": [8, 10]}}  # fmt: skip
    with pytest.raises(InputError, match="holds a computed table; name another schema"):
        tolevo.study(study, tmp_path / "s", store=store)
    assert not (tmp_path / "s").exists()
    postgres.ask(schema, "DELETE FROM meta WHERE key = 'about'")
    postgres.ask(schema, "INSERT INTO meta VALUES ('configuration', 'seeds = 1')")
    with pytest.raises(InputError, match="holds a study; name another schema"):
        evaluated(table, tmp_path / "b.csv", store)


class Told:
    """Writes how many blocks are done to a file, which another process looks at."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __call__(self, state: Any) -> None:
        self.path.write_text(str(state.done), encoding="utf-8")

    @property
    def done(self) -> int:
        try:
            return int(self.path.read_text(encoding="utf-8") or -1)
        except FileNotFoundError:
            return -1


def machine(table: Path, store: str, told: Told) -> None:
    """An evaluation whose claims expire soon, as another machine waits for those of a lost one."""
    store_module.LEASE_S, store_module.RENEWED_S = 4.0, 1.0
    evaluated(table, told.path.with_suffix(".csv"), store, progress=told)


@pytest.mark.slow
def test_machines_and_the_server_are_killed_at_ten_moments(postgres: Server, schema: str, tmp_path: Path) -> None:
    """Ten evaluations by two machines: at some share of each the server and one of them die."""
    blocks, context, struck = 50, multiprocessing.get_context("forkserver"), list[int]()
    context.set_forkserver_preload([__name__, "tolevo.api", "tolevo.blocks"])
    table = designs(tmp_path / "designs.csv", blocks)
    tolevo.evaluate(CONFIGURATION, table, tmp_path / "whole.csv")
    whole = (tmp_path / "whole.csv").read_bytes()
    for moment in range(10):
        own = f"{schema[:50]}_{moment}"
        told = [Told(tmp_path / f"{name}{moment}.txt") for name in ("a", "b")]
        both = [context.Process(target=machine, args=(table, postgres.store(own), one)) for one in told]
        for process in both:
            process.start()
        while min(one.done for one in told) < 0 or max(one.done for one in told) < 4.5 * moment:
            assert any(process.is_alive() for process in both)
            time.sleep(0.001)
        postgres.kill()
        both[1].kill()
        struck.append(max(one.done for one in told))
        postgres.start()
        for process in both:
            process.join()
        assert both[0].exitcode == 0
        assert told[0].path.with_suffix(".csv").read_bytes() == whole
        sound(postgres, own, blocks)
    print(f"killed when {struck} of {blocks} blocks were done")
    assert sum(at < blocks for at in struck) >= 8
