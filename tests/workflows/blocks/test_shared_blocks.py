"""A table whose blocks are in a PostgreSQL server: the same bytes, nothing twice, refused."""

from __future__ import annotations

import multiprocessing
import random
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tolevo
from tests.postgres import Server
from tolevo.errors import InputError
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.workflows.blocks import compute
from tolevo.workflows.evaluate import GRAIN

CONFIGURATION: dict[str, Any] = {"problem": "rv_backlash", "parameters": {"reading": "printed"}}
BLOCKS = 6


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path, problem = tmp_path_factory.mktemp("designs") / "designs.csv", RvBacklash()
    share = np.random.default_rng(1).random((BLOCKS * GRAIN - 5, problem.n_var))
    designs = problem.complete(problem.xl + share * (problem.xu - problem.xl))
    problem.designs_frame(designs).to_csv(path, index=False)
    return path


@pytest.fixture(scope="module")
def whole(table: Path) -> bytes:
    tolevo.evaluate(CONFIGURATION, table, table.with_name("whole.csv"))
    return table.with_name("whole.csv").read_bytes()


def evaluated(table: Path, out: Path, store: str, **more: Any) -> None:
    tolevo.evaluate(CONFIGURATION, table, out, store=store, block_rows=GRAIN, frame=False, **more)


def sound(postgres: Server, schema: str) -> None:
    assert postgres.ask(schema, "SELECT COUNT(*), COUNT(DISTINCT number) FROM blocks") == [
        (BLOCKS, BLOCKS)
    ]
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


def test_a_store_of_something_else_is_refused(
    table: Path, postgres: Server, schema: str, tmp_path: Path
) -> None:
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


@pytest.mark.slow
def test_machines_workers_and_the_server_are_killed(
    table: Path, whole: bytes, postgres: Server, schema: str, tmp_path: Path
) -> None:
    """Ten moments at which the server, and ten at which one of two machines is killed."""
    rng, context = random.Random(2), multiprocessing.get_context("spawn")
    for moment in range(10):
        store = postgres.store(f"{schema[:50]}_{moment}")
        both = [
            context.Process(target=evaluated, args=(table, tmp_path / f"{name}{moment}.csv", store))
            for name in ("a", "b")
        ]
        for one in both:
            one.start()
        while not postgres.ask("public", f"SELECT to_regclass('{schema[:50]}_{moment}.blocks')")[0][
            0
        ]:
            time.sleep(0.02)
        time.sleep(rng.uniform(0.0, 2.0))
        postgres.kill()
        both[1].kill()
        postgres.start()
        for one in both:
            one.join()
        assert both[0].exitcode == 0
        assert (tmp_path / f"a{moment}.csv").read_bytes() == whole
        sound(postgres, f"{schema[:50]}_{moment}")
