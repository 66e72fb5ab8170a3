"""A table by blocks: the same bytes whatever computes them, nothing done twice after a break."""

from __future__ import annotations

import multiprocessing
import os
import random
import signal
import time
from collections.abc import Callable, Iterator
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

import tolevo
from tolevo import blocks
from tolevo.commands import simulate as streamed
from tolevo.commands.evaluate import GRAIN
from tolevo.errors import InputError, RunError
from tolevo.execution import InProcess, Lost, Result, TaskT
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.tolerance_problem import designs_frame, designs_of

CONFIGURATION: dict[str, Any] = {"problem": "rv_backlash", "parameters": {"reading": "printed"}}
ROWS = 5 * GRAIN + 7


def designs(rows: int = ROWS) -> pd.DataFrame:
    problem = RvBacklash()
    share = np.random.default_rng(1).random((rows, problem.n_var))
    return designs_frame(problem, problem.complete(problem.xl + share * (problem.xu - problem.xl)))


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("designs") / "designs.csv"
    designs().to_csv(path, index=False)
    return path


@pytest.fixture(scope="module")
def whole(table: Path) -> bytes:
    """The table as this process writes it in one block."""
    out = table.with_name("whole.csv")
    tolevo.evaluate(CONFIGURATION, table, out, block_rows=ROWS)
    return out.read_bytes()


def test_rows_are_those_of_the_problem_itself(whole: bytes, table: Path) -> None:
    """Against the problem asked for one design at a time."""
    written, problem = pd.read_csv(table.with_name("whole.csv")), RvBacklash()
    configured = tolevo.read(CONFIGURATION).problem
    assert configured is not None
    for row in (0, GRAIN - 1, GRAIN, ROWS - 1):
        design = designs_of(problem, written.iloc[[row]])
        expected = configured.frame(design)["backlash_arcmin"][0]
        # sums of one row and of 64 may be ordered otherwise
        np.testing.assert_allclose(written["backlash_arcmin"][row], expected, rtol=1e-12)


@pytest.mark.parametrize("block_rows", [1, 2 * GRAIN, None])
def test_bytes_do_not_depend_on_the_block(table: Path, whole: bytes, tmp_path: Path, block_rows: int | None) -> None:
    out = tmp_path / "out.csv"
    tolevo.evaluate(CONFIGURATION, table, out, block_rows=block_rows)
    assert out.read_bytes() == whole
    assert list(tmp_path.iterdir()) == [out]  # the blocks are gone


def test_two_processes_write_the_same_bytes(table: Path, whole: bytes, tmp_path: Path) -> None:
    tolevo.evaluate(CONFIGURATION, table, tmp_path / "o.csv", workers=2, block_rows=GRAIN)
    assert (tmp_path / "o.csv").read_bytes() == whole


def test_one_parquet_file_whatever_the_block(table: Path, tmp_path: Path) -> None:
    for name, rows in (("a", 1), ("b", ROWS)):
        tolevo.evaluate(CONFIGURATION, table, tmp_path / f"{name}.parquet", block_rows=rows)
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()
    assert len(pd.read_parquet(tmp_path / "a.parquet")) == ROWS


def test_a_partitioned_table_is_read_as_one(table: Path, whole: bytes, tmp_path: Path) -> None:
    out = tmp_path / "parts"
    tolevo.evaluate(CONFIGURATION, table, out, partitioned=True, block_rows=2 * GRAIN)
    parts = sorted(path.name for path in out.glob("part-*.parquet"))
    assert parts == ["part-000000.parquet", "part-000001.parquet", "part-000002.parquet"]
    read = pq.ParquetDataset(out).read().to_pandas()
    read.to_csv(tmp_path / "read.csv", index=False)
    assert (tmp_path / "read.csv").read_bytes() == whole


class Ending(InProcess):
    """An executor that is lost after some tasks."""

    def __init__(self, after: int) -> None:
        self.left = after
        self.done: list[Any] = []

    def completed(
        self, function: Callable[[TaskT], Result], source: Callable[[], TaskT | None]
    ) -> Iterator[tuple[TaskT, Result | Lost]]:
        for pair in super().completed(function, source):
            if not self.left:
                raise RunError("the scheduler was lost")
            self.left -= 1
            self.done.append(pair[0].key)
            yield pair


def test_after_a_break_only_what_is_missing_is_computed(
    table: Path, whole: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between two blocks, at the beginning and at the end; told what is saved and how to go on."""
    for after in (0, 2, 5):
        out, first, second = tmp_path / f"{after}.csv", Ending(after), Ending(99)
        for executor in (first, second):
            monkeypatch.setattr("tolevo.execution.executor_of", lambda *_, one=executor: one)
            arguments: dict[str, Any] = {"block_rows": GRAIN, "resume": executor is second}
            if executor is first:
                with pytest.raises(RunError, match=rf"{after} of 6 blocks are saved.*--resume"):
                    tolevo.evaluate(CONFIGURATION, table, out, **arguments)
            else:
                tolevo.evaluate(CONFIGURATION, table, out, **arguments)
        assert len(second.done) == 6 - after
        assert not set(first.done) & set(second.done)
        assert out.read_bytes() == whole


def test_damaged_and_half_written_blocks_are_computed_again(
    table: Path, whole: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A byte of one block is another, one is gone, and the last line of the log is torn."""
    out, executor = tmp_path / "o.csv", Ending(5)
    monkeypatch.setattr("tolevo.execution.executor_of", lambda *_: executor)
    with pytest.raises(RunError, match="5 of 6 blocks"):
        tolevo.evaluate(CONFIGURATION, table, out, block_rows=GRAIN)
    folder = tmp_path / "o.csv.blocks"
    content = bytearray((folder / "part-000001.parquet").read_bytes())
    content[len(content) // 2] ^= 1
    (folder / "part-000001.parquet").write_bytes(content)
    (folder / "part-000003.parquet").unlink()
    log = (folder / "_parts.txt").read_text()
    (folder / "_parts.txt").write_text(log[:-20])
    executor = Ending(99)
    tolevo.evaluate(CONFIGURATION, table, out, resume=True)  # rows of a block as before
    assert len(executor.done) == 4  # 1, 3, the one with the torn line, and the last
    assert out.read_bytes() == whole


def test_blocks_of_something_else_are_refused(table: Path, tmp_path: Path) -> None:
    out, other = tmp_path / "parts", tmp_path / "other.csv"
    tolevo.evaluate(CONFIGURATION, table, out, partitioned=True)
    designs(3 * GRAIN).to_csv(other, index=False)
    before = {path: path.read_bytes() for path in out.iterdir()}
    with pytest.raises(InputError, match=r"holds blocks of another table.*of another length"):
        tolevo.evaluate(CONFIGURATION, other, out, partitioned=True, resume=True)
    changed = {**CONFIGURATION, "seed": 3}
    with pytest.raises(InputError, match="holds blocks of another configuration; name another"):
        tolevo.evaluate(changed, table, out, partitioned=True, resume=True)
    with pytest.raises(InputError, match="blocks of an earlier command; continue with --resume"):
        tolevo.evaluate(CONFIGURATION, table, out, partitioned=True)
    assert {path: path.read_bytes() for path in out.iterdir()} == before
    tolevo.evaluate(changed, table, out, partitioned=True, overwrite=True)


def test_where_it_runs_is_no_part_of_the_configuration(tmp_path: Path) -> None:
    """The table `[execution]` changes neither the resolved configuration nor its hash."""
    wide = {**CONFIGURATION, "execution": {"workers": 2, "block_rows": 100}}
    assert tolevo.read(wide).hash == tolevo.read(CONFIGURATION).hash
    assert "execution" not in tolevo.check(wide)


def test_the_configuration_says_where_to_run(table: Path, whole: bytes, tmp_path: Path) -> None:
    seen: list[int] = []
    wide = {**CONFIGURATION, "execution": {"block_rows": GRAIN}}
    tolevo.evaluate(wide, table, tmp_path / "o.csv", progress=lambda at: seen.append(at.total))
    assert set(seen) == {6}
    assert (tmp_path / "o.csv").read_bytes() == whole


@pytest.mark.parametrize(
    ("execution", "said"),
    [
        ({"workers": 0}, "execution.workers: must be at least 1, got 0"),
        ({"block_rows": 0}, "execution.block_rows: must be at least 1, got 0"),
        ({"wokers": 2}, "execution.wokers: is not a known key (did you mean `workers`?)"),
        ({"workers": 2, "dask": "tcp://127.0.0.1:9"}, "execution.dask: is a scheduler with its own workers"),
        ({"dask": "tcp://127.0.0.1:9"}, "execution.dask: no Dask scheduler answers at tcp://127"),
        ({"workers": 10**7}, "execution.workers: 10000000 processes would need"),
        ({"store": "postgresql://me@host/db"}, "execution.store: is no key any more"),
    ],
)
def test_faults_of_the_table_come_with_those_of_the_rest(
    table: Path, tmp_path: Path, execution: dict[str, Any], said: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr("tolevo.dask_cluster.PATIENCE", 0.5)
    wrong = {**CONFIGURATION, "limits": {"nonsense": 1.0}, "execution": execution}
    with pytest.raises(InputError) as caught:
        tolevo.evaluate(wrong, table, tmp_path / "o.csv", block_rows=0, quality="best")
    text = str(caught.value)
    assert said in text
    assert "limits.nonsense" in text
    assert "--block-rows: must be at least 1, got 0" in text
    assert '--quality: must be one of reported, search, got "best"' in text
    with pytest.raises(InputError) as caught:
        tolevo.check(wrong)
    checked = [str(fault) for fault in caught.value.faults]
    assert any(line.startswith(said) for line in checked)
    others = [line for line in checked if not line.startswith("execution.")]
    assert others == ["limits.nonsense: is not a known key"]
    assert not list(tmp_path.iterdir())


def test_options_come_before_the_configuration(table: Path, tmp_path: Path) -> None:
    wide = {**CONFIGURATION, "execution": {"dask": "tcp://127.0.0.1:9"}}
    tolevo.evaluate(wide, table, tmp_path / "o.csv", workers=1)
    assert (tmp_path / "o.csv").is_file()


def test_search_quality_is_what_a_search_sees(tmp_path: Path) -> None:
    problem = tolevo.read({"problem": "pose_accuracy"}).problem
    assert problem is not None
    full = problem.complete(np.stack([problem.xl, problem.xu]))
    frame = designs_frame(problem, full)
    found = tolevo.evaluate({"problem": "pose_accuracy"}, frame, quality="search")
    seen = problem.outputs_of(full, searching=True)
    for name in problem.objectives:
        np.testing.assert_array_equal(found[name], seen[name])


# ---------------------------------------------------------------- operating points


def points(rows: int) -> pd.DataFrame:
    rng = np.random.default_rng(2)
    return pd.DataFrame({
        "torque_Nm": rng.uniform(-300.0, 300.0, rows),
        "direction": rng.choice([-1.0, 1.0], rows),
        "twist_arcmin": 0.0,
    })  # fmt: skip


def test_parquet_read_in_batches_gives_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file read as a whole, in batches, and three files of a directory."""
    rows, model = 200_000, {"model": "rv_lost_motion"}
    frame, folder = points(rows), tmp_path / "points"
    folder.mkdir()
    frame.to_parquet(tmp_path / "p.parquet", index=False)
    for at, part in enumerate(np.array_split(np.arange(rows), 3)):
        frame.iloc[part].to_parquet(folder / f"{at}.parquet", index=False)
    lines: list[str] = []
    tolevo.simulate(model, tmp_path / "p.parquet", tmp_path / "a.parquet")
    monkeypatch.setattr(streamed, "STREAMED_ROWS", 1000)
    found = tolevo.simulate(model, tmp_path / "p.parquet", tmp_path / "b.parquet", tell=lines.append, frame=False)
    tolevo.simulate(model, folder, tmp_path / "c.parquet", frame=False)
    contents = {(tmp_path / f"{name}.parquet").read_bytes() for name in "abc"}
    assert len(contents) == 1
    assert len(found) == 0
    assert any("200000 rows; parquet, read in batches" in line for line in lines)
    assert any("twist_arcmin as written are predictions" in line for line in lines)


def test_cells_of_a_long_table_are_looked_at_before_anything_is_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(streamed, "STREAMED_ROWS", 1000)
    frame = points(150_000)
    frame.loc[140_000, "torque_Nm"] = np.nan
    frame.to_parquet(tmp_path / "p.parquet", index=False)
    with pytest.raises(InputError, match=r"p.parquet: row 140001, column torque_Nm"):
        tolevo.simulate({"model": "rv_lost_motion"}, tmp_path / "p.parquet", tmp_path / "o.csv")
    assert not (tmp_path / "o.csv").exists()


def test_units_are_drawn_by_their_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Units of a batch model: the first rows of a long table are those of a short one."""
    monkeypatch.setattr("tolevo.commands.simulate.GRAIN", 500)
    model = {"model": "rv_batch", "seed": 5}
    short = tolevo.simulate(model, pd.DataFrame({"unit": np.arange(500)}))
    long = tolevo.simulate(model, pd.DataFrame({"unit": np.arange(1700)}))
    wide = tolevo.simulate(model, pd.DataFrame({"unit": np.arange(1700)}), workers=2,
                           block_rows=500)  # fmt: skip
    np.testing.assert_array_equal(long["backlash_arcmin"][:500], short["backlash_arcmin"])
    np.testing.assert_array_equal(long["backlash_arcmin"], wide["backlash_arcmin"])
    means = [long["backlash_arcmin"][at : at + 500].mean() for at in (0, 500, 1000)]
    assert len(set(means)) == 3  # streams of their own


def test_rows_about_one_unit_stay_together() -> None:
    """Repeats of a unit are one unit, wherever in a long table they stand."""
    model = tolevo.read({"model": "rv_batch"})
    frame = pd.DataFrame({"unit": np.tile(np.arange(40), 2), "repeat": np.repeat([1, 2], 40)})
    found = tolevo.simulate(model, frame, workers=2, block_rows=1)["backlash_arcmin"]
    np.testing.assert_array_equal(found[:40], found[40:])


def test_tasks_bear_the_name_of_their_table(table: Path) -> None:
    """Equal keys would bring back another table's result from a scheduler that has it stored."""
    rows = blocks.ArrayRows(np.zeros((3, 2)))
    keys = set()
    for configuration in ("a", "b"):
        made = blocks.Computed("evaluate", lambda rows, n: pd.DataFrame(rows), configuration, rows, 64)
        store = blocks.InMemory(made.about(None))
        keys |= {task.key for task in blocks._tasks(made, store, 1, apart=False)}
    assert len(keys) == 2


def one_worker_killed(table: Path, whole: bytes, out: Path, at: int) -> None:
    """SIGKILL to one of two processes once `at` blocks have ended: the same bytes."""
    others, killed = set(active_children()), list[int]()

    def report(state: Any) -> None:
        workers = [one.pid for one in active_children() if one not in others]
        if state.done >= at and not killed and len(workers) == 2:
            killed.append(workers[0] or 0)
            os.kill(killed[0], signal.SIGKILL)

    tolevo.evaluate(CONFIGURATION, table, out, workers=2, block_rows=GRAIN, progress=report)
    assert len(killed) == 1
    assert out.read_bytes() == whole


def test_a_killed_worker_costs_its_block_only(table: Path, whole: bytes, tmp_path: Path) -> None:
    one_worker_killed(table, whole, tmp_path / "o.csv", 1)


@pytest.mark.slow
def test_a_worker_killed_at_twenty_moments(table: Path, whole: bytes, tmp_path: Path) -> None:
    for trial in range(20):
        one_worker_killed(table, whole, tmp_path / f"{trial}.csv", trial % 4)


@pytest.mark.slow
def test_killed_at_twenty_moments(table: Path, whole: bytes, tmp_path: Path) -> None:
    """The whole command by SIGKILL, gone on with each time, until it is through."""
    killed_until_done(table, whole, tmp_path, 20)


def test_killed_at_two_moments(table: Path, whole: bytes, tmp_path: Path) -> None:
    killed_until_done(table, whole, tmp_path, 2)


def test_killed_before_the_first_line(table: Path, whole: bytes, tmp_path: Path) -> None:
    """A lock and the beginning of the first file are no table of somebody else."""
    blocks_of = tmp_path / "o.csv.blocks"
    blocks_of.mkdir()
    (blocks_of / "_lock").touch()
    (blocks_of / "._table.json.0123abcd.part").touch()
    tolevo.evaluate(CONFIGURATION, table, tmp_path / "o.csv", block_rows=GRAIN, resume=True)
    assert (tmp_path / "o.csv").read_bytes() == whole


def killed_until_done(table: Path, whole: bytes, tmp_path: Path, kills: int) -> None:
    context, out, moments = multiprocessing.get_context("fork"), tmp_path / "o.csv", kills
    rng, caught = random.Random(3), 0
    while caught < moments:
        arguments: dict[str, Any] = {"block_rows": GRAIN, "resume": True}
        one = context.Process(target=tolevo.evaluate, args=(CONFIGURATION, table, out), kwargs=arguments)
        one.start()
        time.sleep(rng.uniform(0.02, 0.5))
        one.kill()
        one.join()
        caught += 1
        if one.exitcode == 0:
            assert out.read_bytes() == whole
            out = tmp_path / f"{caught}.csv"
    tolevo.evaluate(CONFIGURATION, table, out, resume=True)
    assert out.read_bytes() == whole


def test_killed_before_it_is_said_whose_blocks_they_are(table: Path, whole: bytes, tmp_path: Path) -> None:
    out, folder = tmp_path / "o.csv", tmp_path / "o.csv.blocks"
    folder.mkdir()
    for name in ("_lock", "._table.json.0123abcd.part"):
        (folder / name).touch()
    tolevo.evaluate(CONFIGURATION, table, out, resume=True)
    assert out.read_bytes() == whole
