"""The database of a study: resumed, refused, damaged, full."""

from __future__ import annotations

import os
import resource
import shutil
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner, Result

from tests.small_jobs import POSE_BY_GA
from tolevo.cli import app
from tolevo.commands.study.configuration import read_study
from tolevo.commands.study.plan import StudyOutcome
from tolevo.commands.study.storage import DATABASE, FORMAT
from tolevo.commands.study.study import study
from tolevo.directory import KINDS, MANIFEST, standing
from tolevo.directory import own_folder as owned
from tolevo.directory.standing import present_files, write_unfinished
from tolevo.errors import InputError
from tolevo.execution import InProcess
from tolevo.files import write_record

pytestmark = pytest.mark.usefixtures("unrendered")

RUN = POSE_BY_GA.format(mrad=0.6, more="", population=8, generations=40)
STUDY = """
run = "run.toml"
seeds = 10
[design]
kind = "factorial"
[vary]
"algorithm.population" = [8, 10]
"algorithm.mutation.probability" = [0.05, 0.1]
"""
RUNS = 40


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    (folder / "run.toml").write_text(RUN, encoding="utf-8")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    return folder / "study.toml"


@pytest.fixture(scope="module")
def finished(config: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished study; the tests work on copies."""
    out = tmp_path_factory.mktemp("finished")
    study(read_study(config), out, InProcess())
    return out


@pytest.fixture
def out(finished: Path, tmp_path: Path) -> Path:
    """A finished study that may be spoilt."""
    found = tmp_path / "out"
    shutil.copytree(finished, found)
    return found


def resumed(config: Path, out: Path, *overrides: str) -> StudyOutcome:
    return study(read_study(config, overrides), out, InProcess(), resume=True)


def command(config: Path, out: Path, *arguments: str) -> Result:
    words = ["study", str(config), "--out", str(out), "--quiet", "--workers", "1", *arguments]
    return CliRunner().invoke(app, words)


def changed(out: Path, *statements: str) -> None:
    connection = sqlite3.connect(out / DATABASE)
    for statement in statements:
        connection.execute(statement)
    connection.commit()
    connection.close()


def refused(config: Path, out: Path, *overrides: str) -> str:
    with pytest.raises(InputError) as caught:
        resumed(config, out, *overrides)
    return str(caught.value)


@pytest.mark.timed
def test_a_finished_study_reopens_in_a_second(config: Path, out: Path) -> None:
    before = (out / "study.csv").read_bytes()
    plan = read_study(config)
    start = time.process_time()
    outcome = study(plan, out, InProcess(), resume=True)
    assert time.process_time() - start < 1.0
    assert outcome.status == "done"
    assert (out / "study.csv").read_bytes() == before
    assert standing(out).complete  # its database, too, is as it was


def test_every_file_is_known_by_name(finished: Path) -> None:
    """What is not would be in no manifest, and would outlive the study that it belongs to."""
    kind = KINDS["study"]
    known = {*present_files(finished, (*kind.files, *kind.pages)), MANIFEST}
    assert {path.name for path in finished.iterdir()} == known
    assert standing(finished).complete


def test_seeds_may_grow_and_only_the_new_runs_are_made(config: Path, out: Path) -> None:
    before = pd.read_csv(out / "study.csv")
    changed(out, "UPDATE runs SET seed = seed")  # as it is: the rows are whole
    resumed(config, out, "seeds=12")
    after = pd.read_csv(out / "study.csv")
    assert len(after) == 48
    old = after[after["replicate"] < 10].reset_index(drop=True)
    pd.testing.assert_frame_equal(old, before)
    assert after["seed"].nunique() == 12
    assert refused(config, out, "seeds=3").startswith("seeds: is 3, but the study to resume has 12")


@pytest.mark.parametrize(
    ("override", "place"),
    [
        ("seed=5", "seed: is 5, but the study to resume has 0"),
        ("run.algorithm.generations=41", "run.algorithm.generations: is 41"),
        ('vary={"algorithm.population" = [8, 9]}', "vary.algorithm.population: is [8, 9]"),
    ],
)
def test_the_database_of_another_study_is_refused(config: Path, out: Path, override: str, place: str) -> None:
    before = (out / DATABASE).read_bytes()
    assert place in refused(config, out, override)
    assert (out / DATABASE).read_bytes() == before


OLD = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE runs (
  number INTEGER PRIMARY KEY, point INTEGER NOT NULL, replicate INTEGER NOT NULL,
  seed INTEGER NOT NULL, status TEXT NOT NULL, reason TEXT NOT NULL, evaluations INTEGER,
  cpu_s REAL, hypervolume_ratio REAL, hypervolume REAL, gap_percent REAL, evaluations_to_99 REAL,
  cpu_s_to_99 REAL, feasible_fraction REAL, curve BLOB, checksum INTEGER,
  UNIQUE (point, replicate));
CREATE TABLE claims (number INTEGER PRIMARY KEY, owner TEXT NOT NULL);
CREATE TABLE yardsticks (problem INTEGER PRIMARY KEY, value TEXT NOT NULL);
PRAGMA application_id = 1953264500;
"""
"""The tables as versions 1 to 3 made them, as far as they are read."""


@pytest.mark.parametrize("version", [1, 2, 3])
def test_a_database_of_an_older_version_is_gone_on_with(config: Path, out: Path, version: int) -> None:
    """All of its runs count, a claim does not, a lost run is done; the tables stay as they were."""
    table = (out / "study.csv").read_bytes()
    (out / DATABASE).rename(out / "new")
    connection = sqlite3.connect(out / DATABASE)
    connection.executescript(OLD)
    connection.execute("ATTACH ? AS new", (str(out / "new"),))
    connection.execute("INSERT INTO meta SELECT * FROM new.meta")
    connection.execute("INSERT INTO runs SELECT * FROM new.runs")
    connection.execute("INSERT INTO yardsticks SELECT problem, CAST(value AS TEXT) FROM new.yardsticks")
    connection.execute("DELETE FROM runs WHERE number = 7")
    connection.execute("INSERT INTO claims VALUES (7, '123-abc')")
    if version == 1:
        connection.execute("DELETE FROM meta WHERE key = 'sha256'")
    connection.execute(f"PRAGMA user_version = {version}")
    connection.commit()
    connection.close()
    (out / "new").unlink()
    done: list[int] = []
    plan = read_study(config)
    study(plan, out, InProcess(), lambda state: done.append(state.done), resume=True)
    assert done[0] == RUNS - 1
    assert (out / "study.csv").read_bytes() == table
    connection = sqlite3.connect(out / DATABASE)
    assert connection.execute("PRAGMA user_version").fetchone() == (version,)
    assert connection.execute("SELECT value FROM meta WHERE key = 'sha256'").fetchone() is not None
    connection.close()


@pytest.mark.parametrize("resume", ["--resume", "--overwrite"])
def test_runs_in_a_postgresql_database_are_left_to_the_version_that_reads_them(
    config: Path, out: Path, resume: str
) -> None:
    """A directory of 0.2.0 whose study was in a store that machines shared."""
    table = (out / "study.csv").read_bytes()
    for path in out.glob("*"):
        path.unlink()
    write_record(out / "store.json", {"store": "postgresql://me@host/db?schema=s", "directory": "0123"})
    write_unfinished(out, "study", "0123")
    before = sorted((path.name, path.read_bytes()) for path in out.iterdir())
    result = command(config, out, resume)
    if resume == "--resume":
        assert result.exit_code == 2
        assert "are in a PostgreSQL database (see store.json): continue it with tolevo 0.2.0" in result.stderr
        assert sorted((path.name, path.read_bytes()) for path in out.iterdir()) == before
    else:
        assert (out / "study.csv").read_bytes() == table
        assert not (out / "store.json").exists()


@pytest.mark.parametrize("kept", ['execution.store="postgresql://me@host/db"', 'execution.store=""'])
def test_a_store_that_machines_share_is_refused_with_a_remedy(config: Path, tmp_path: Path, kept: str) -> None:
    result = command(config, tmp_path / "new", "--set", kept)
    assert result.exit_code == 2
    assert result.stderr.startswith("execution.store: is no key any more")
    assert "name a Dask scheduler by execution.dask or --dask" in result.stderr
    assert not (tmp_path / "new").exists()


def test_a_newer_database_is_refused(config: Path, out: Path) -> None:
    changed(out, f"PRAGMA user_version = {FORMAT + 1}")
    result = command(config, out, "--resume")
    assert result.exit_code == 2
    assert f"newer version of tolevo (format {FORMAT + 1}" in result.stderr


def test_a_database_of_something_else_is_refused(config: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    changed(tmp_path / "out", "CREATE TABLE runs (x)")
    assert "is not the database of a study" in refused(config, tmp_path / "out")


def test_a_directory_that_holds_a_study_is_refused(config: Path, out: Path) -> None:
    result = command(config, out)
    assert result.exit_code == 2
    assert "is not empty" in result.stderr
    assert command(config, out, "--overwrite").exit_code == 0


def test_a_study_under_way_is_not_overwritten(config: Path, out: Path) -> None:
    with owned(out, "study", resume=True):
        result = command(config, out, "--overwrite")
    assert result.exit_code == 2
    assert f"--out: {out} is in use by `tolevo study` (process {os.getpid()} on" in result.stderr


def pages_zeroed(path: Path) -> None:
    """The last third of the file, from a page boundary on."""
    size = path.stat().st_size
    start = 2 * size // 3 // 4096 * 4096
    with path.open("r+b") as file:
        file.seek(start)
        file.write(b"\xa5" * (size - start))


def cut_short(path: Path) -> None:
    with path.open("r+b") as file:
        file.truncate(path.stat().st_size // 2 // 4096 * 4096)


@pytest.mark.parametrize("damage", [pages_zeroed, cut_short])
def test_what_is_whole_of_a_damaged_database_is_kept(config: Path, out: Path, damage: Callable[[Path], None]) -> None:
    before = (out / "study.csv").read_bytes()
    damage(out / DATABASE)
    outcome = resumed(config, out)
    note = next(line for line in outcome.lines if "was damaged" in line)
    kept = int(note.partition("): ")[2].split()[0])
    assert 0 < kept < RUNS
    assert f"{RUNS - kept} runs (point " in note
    assert (out / f"{DATABASE}.damaged-1").exists()
    assert (out / "study.csv").read_bytes() == before


def test_a_changed_row_is_done_again(config: Path, out: Path) -> None:
    """A value that was changed within a sound database is found by its checksum."""
    before = (out / "study.csv").read_bytes()
    changed(out, "UPDATE runs SET gap_percent = 0.0 WHERE point = 1 AND replicate = 3")
    outcome = resumed(config, out)
    assert any("1 runs (point 1 replicate 3)" in line for line in outcome.lines)
    assert (out / "study.csv").read_bytes() == before


def test_nothing_whole_is_said_and_kept(config: Path, out: Path) -> None:
    (out / DATABASE).write_bytes(b"\xa5" * 20_000)
    before = sorted(path.name for path in out.iterdir())
    text = refused(config, out)
    assert "is damaged" in text
    assert "none of its runs can be read" in text
    assert sorted(path.name for path in out.iterdir()) == before


def test_a_full_disk_in_mid_study(config: Path, finished: Path, tmp_path: Path) -> None:
    """No file may grow beyond 90 kB: what had ended is kept, and --resume goes on."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (90_000, 90_000))

    words = [sys.executable, "-m", "tolevo", "study", str(config), "--out", str(tmp_path / "o"),
             "--quiet", "--workers", "1"]  # fmt: skip
    found = subprocess.run(words, preexec_fn=limit, capture_output=True, text=True, timeout=120)
    assert found.returncode == 1, found.stderr
    assert "cannot be written" in found.stderr
    assert "--resume" in found.stderr
    assert "Traceback" not in found.stderr
    connection = sqlite3.connect(tmp_path / "o" / DATABASE)
    kept = connection.execute("SELECT COUNT(*) FROM runs").fetchone()[0]
    connection.close()
    assert 0 < kept < RUNS
    assert f"{kept} of {RUNS} runs have ended" in found.stderr
    assert command(config, tmp_path / "o", "--resume").exit_code == 0
    assert (tmp_path / "o" / "study.csv").read_bytes() == (finished / "study.csv").read_bytes()
