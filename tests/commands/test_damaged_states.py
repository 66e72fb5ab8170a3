"""Replicates, claims and databases that were damaged: refused, or done again to the same result."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import Result

from tests.fuzzing import share
from tests.small_jobs import CLAIMS, tolevo
from tests.small_jobs import GAP as SMALL_GAP
from tolevo.commands.reproduce.calculations.manipulator import GaSettings
from tolevo.commands.study.configuration import read_study
from tolevo.commands.study.study import study
from tolevo.directory import MANIFEST
from tolevo.directory.standing import write_unfinished
from tolevo.errors import InputError
from tolevo.execution import InProcess

pytestmark = pytest.mark.usefixtures("unrendered")

TRIALS = share(2)
GAP = SMALL_GAP.replace("bootstrap = 8", "bootstrap = 4")
STUDY = """
seeds = 4
[design]
kind = "factorial"
[vary]
"algorithm.population" = [8, 10]
[run]
problem = "pose_accuracy"
parameters = { index = "rms_plane" }
objectives = { minimise = ["cost"] }
limits = { squareness_mrad = 0.6 }
algorithm = { name = "ga", population = 8, generations = 10 }
"""
Spoilt = tuple[Path, Callable[[], Result]]


@pytest.fixture(scope="module")
def analysis(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An analysis that has its replicates."""
    folder, rng = tmp_path_factory.mktemp("gap"), np.random.default_rng(0)
    torque = rng.uniform(-400.0, 400.0, 90)
    te = 0.25 * torque + rng.normal(0.0, 2.0, 90)
    frame = pd.DataFrame({"torque": torque, "te": te, "te_predicted": 0.2 * torque})
    frame.to_csv(folder / "data.csv", index=False)
    (folder / "gap.toml").write_text(GAP, encoding="utf-8")
    ended = tolevo("gap", folder / "gap.toml", folder / "data.csv", "--out", folder / "out",
                   "--quiet", "--workers", 1)  # fmt: skip
    assert ended.exit_code == 0, ended.stderr
    return folder


@pytest.fixture(scope="module")
def claims(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A reproduction that has its claim."""
    folder = tmp_path_factory.mktemp("claims")
    (folder / "paper.toml").write_text(CLAIMS, encoding="utf-8")
    words = ("reproduce", folder / "paper.toml", "--out", folder / "out", "--quiet")
    ended = tolevo(*words, "--workers", 1)
    assert ended.exit_code == 0, ended.stderr
    return folder


@pytest.fixture
def replicates(analysis: Path, tmp_path: Path) -> Spoilt:
    """The replicates of a broken analysis (no manifest), and the command that would go on."""
    out = tmp_path / "out"
    shutil.copytree(analysis / "out", out)
    for name in (MANIFEST, "gap.json"):
        (out / name).unlink()
    words = ("gap", analysis / "gap.toml", analysis / "data.csv", "--out", out, "--resume")
    return out / "replicates.jsonl", lambda: tolevo(*words, "--quiet", "--workers", 1)


@pytest.fixture
def claim(claims: Path, tmp_path: Path) -> Spoilt:
    """The same of a reproduction."""
    out = tmp_path / "out"
    shutil.copytree(claims / "out", out)
    (out / MANIFEST).unlink()
    words = ("reproduce", claims / "paper.toml", "--out", out, "--resume")
    return out / "checked" / "0_0.json", lambda: tolevo(*words, "--quiet", "--workers", 1)


@pytest.mark.parametrize("name", ["replicates", "claim"])
def test_a_changed_byte_is_refused(name: str, request: pytest.FixtureRequest) -> None:
    """Forty of them, seeded: said with the place, status 2, and nothing is written."""
    path, resume = request.getfixturevalue(name)
    whole, rng = path.read_bytes(), np.random.default_rng(5)
    for at in rng.integers(0, len(whole) - 1, 40):  # but the end of the last line
        changed = bytearray(whole)
        changed[at] ^= int(rng.integers(1, 256))
        if bytes(changed).split() == whole.split():
            continue  # another blank means the same
        path.write_bytes(changed)
        found = resume()
        assert found.exit_code == 2, (at, found.output)
        assert found.stderr.startswith(str(path))
        assert "cannot be read: " in found.stderr
        assert path.read_bytes() == changed


def test_a_line_of_another_analysis_is_refused(replicates: Spoilt, analysis: Path) -> None:
    """Well formed and with a digest of its own, but another's."""
    path, resume = replicates
    words = ("gap", analysis / "gap.toml", analysis / "data.csv", "--set", "seed=3", "--quiet")
    other = path.parent.with_name("other")
    assert tolevo(*words, "--out", other, "--workers", 1).exit_code == 0
    lines, others = (one.read_text(encoding="utf-8").splitlines() for one in (path, other / path.name))
    path.write_text("\n".join([*lines[:2], others[2], *lines[3:]]) + "\n", encoding="utf-8")
    found = resume()
    assert found.exit_code == 2
    assert found.stderr.startswith(f"{path}, line 3: cannot be read: it is damaged")


# ---------------------------------------------------------------- the database of a study


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    study(read_study(folder / "study.toml"), folder / "out", InProcess())
    return folder


@pytest.fixture
def database(finished: Path, tmp_path: Path) -> Path:
    shutil.copytree(finished / "out", tmp_path / "out")
    return tmp_path / "out" / "study.sqlite"


def changed(database: Path, statement: str, *values: object) -> None:
    connection = sqlite3.connect(database)
    connection.execute(statement, values)
    connection.commit()
    connection.close()


def test_a_changed_yardstick_is_found_again(finished: Path, database: Path) -> None:
    """What every gap of the study is measured by; before, a changed one changed them all."""
    text = "UPDATE yardsticks SET value = replace(value, '\"bound\": ', '\"bound\": 1')"
    changed(database, text)
    before = (database.parent / "study.csv").read_bytes()
    plan = read_study(finished / "study.toml", ["seeds=5"])
    study(plan, database.parent, InProcess(), resume=True)
    after = (database.parent / "study.csv").read_bytes()
    study(plan, database.parent.with_name("whole"), InProcess())
    assert after == (database.parent.with_name("whole") / "study.csv").read_bytes()
    assert after != before


@pytest.mark.parametrize("key", ["configuration", "points", "sha256"])
@pytest.mark.parametrize("value", ["seeds = ", "", "\x00", b"\xff\xfe"])
def test_a_changed_identity_is_refused(finished: Path, database: Path, key: str, value: object) -> None:
    changed(database, "UPDATE meta SET value = CAST(? AS TEXT) WHERE key = ?", value, key)
    with pytest.raises(InputError) as caught:
        study(read_study(finished / "study.toml"), database.parent, InProcess(), resume=True)
    assert str(caught.value).startswith(f"{database}: cannot be read: ")


def test_bytes_changed_anywhere_in_a_database(finished: Path, database: Path) -> None:
    """Refused, or what was lost is done again: the table is the same in every case."""
    out, whole = database.parent, database.read_bytes()
    expected = (out / "study.csv").read_bytes()
    rng, same = np.random.default_rng(8), 0
    plan = read_study(finished / "study.toml")
    for _ in range(TRIALS):
        spoilt = bytearray(whole)
        for at in rng.integers(0, len(whole), 3):
            spoilt[at] ^= int(rng.integers(1, 256))
        database.write_bytes(spoilt)
        with suppress(InputError):
            outcome = study(plan, out, InProcess(), resume=True)
            assert outcome.status == "done"
            assert (out / "study.csv").read_bytes() == expected
            same += 1
        for left in out.glob("study.sqlite*"):
            left.unlink()
    assert same > TRIALS // 3


def test_runs_are_not_taken_from_a_study_that_is_not_whole(database: Path) -> None:
    """By `reproduce`, which reads the table of a study: edited, and unfinished."""
    folder = database.parent
    own = {"study": str(folder)}
    (folder / "study.csv").write_text("point\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"study\.csv: is not the file that this result was"):
        GaSettings().compute(own, np.random.default_rng(0))
    (folder / MANIFEST).unlink()
    write_unfinished(folder, "study", "of one that was killed")
    with pytest.raises(InputError, match="this result of `tolevo study` is unfinished: complete it"):
        GaSettings().compute(own, np.random.default_rng(0))
