"""`tolevo report`: pages from directories that are whole, broken, newer or edited by hand."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.small_jobs import TWO_PARTS, tolevo
from tolevo.algorithms.archive import CURVE
from tolevo.commands.comparison import compare_runs as compared
from tolevo.commands.study.storage import DATABASE, Database
from tolevo.commands.study.trial import RunRecord
from tolevo.directory import MANIFEST
from tolevo.directory.standing import write_unfinished
from tolevo.records import Axis, RunResult

CONFIG = TWO_PARTS.replace('"gap"', '"<script>alert(1)</script>"').replace('name = "random"\n', "")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    config = folder / "c.toml"
    config.write_text(CONFIG, encoding="utf-8")
    result = tolevo("run", config, "--out", folder / "run", "--quiet", "--workers", 1)
    assert result.exit_code == 0, result.stderr
    return folder / "run"


@pytest.fixture
def complete(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "run"))


@pytest.fixture
def run(complete: Path) -> Path:
    """As earlier versions left it: without a manifest, whatever is there is shown."""
    (complete / MANIFEST).unlink()
    return complete


def rebuilt(run: Path) -> tuple[str, str]:
    (run / "report.html").unlink()
    result = tolevo("report", run)
    assert result.exit_code == 0, result.stderr
    assert str(run / "report.html") in result.stdout
    return (run / "report.html").read_text(encoding="utf-8"), result.stderr


def test_a_whole_directory_gives_the_same_page(complete: Path) -> None:
    before = (complete / "report.html").read_text(encoding="utf-8")
    after, warned = rebuilt(complete)
    assert warned == ""
    assert after == before


def test_a_page_elsewhere(run: Path, tmp_path: Path) -> None:
    assert tolevo("report", run, "--out", tmp_path / "x.html").exit_code == 0
    assert (tmp_path / "x.html").stat().st_size > 1e5
    refused = tolevo("report", run, "--out", tmp_path / "x.csv")
    assert refused.exit_code == 2
    assert "must end with .html" in refused.stderr


def test_an_edited_table_is_named_with_what_is_wrong(run: Path) -> None:
    lines = (run / "front.csv").read_text(encoding="utf-8").splitlines()
    lines[3] = "oops" + lines[3][lines[3].index(",") :]
    cost = lines[0].split(",").index("cost")
    cells = lines[5].split(",")
    lines[5] = ",".join([*cells[:cost], "cheap", *cells[cost + 1 :]])
    (run / "front.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    page, warned = rebuilt(run)
    assert "front.csv: was changed after it was written" in warned
    assert "front.csv: line 6, column cost: no finite number" in warned
    assert "What is wrong with the files" in page
    assert "line 6, column cost" in page


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("summary.json", "summary.json: is missing"),
        ("references.csv", "references.csv: is missing"),
        ("convergence.csv", "convergence.csv: is missing"),
        ("config.toml", "config.toml: is missing"),
        ("front.csv", "front.parquet: is shown in place of front.csv"),
    ],
)
def test_what_is_left_of_a_directory_is_shown(complete: Path, name: str, words: str) -> None:
    (complete / name).unlink()
    page, warned = rebuilt(complete)
    assert words in warned
    assert 'id="work"' in page


def test_a_broken_summary_leaves_the_objectives_of_the_configuration(run: Path) -> None:
    (run / "summary.json").write_text('{"status": "done",', encoding="utf-8")
    page, warned = rebuilt(run)
    assert "summary.json: is not JSON" in warned
    assert '"objectives":[{"name":"cost"' in page


def test_a_summary_of_wrong_types(run: Path) -> None:
    summary = json.loads((run / "summary.json").read_text(encoding="utf-8"))
    summary |= {"axes": 3, "ideal": [1], "bars": "no", "notes": {}, "rounding": None, "files": 1}
    (run / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    _, warned = rebuilt(run)
    for name in ("axes", "ideal", "bars", "notes", "files"):
        assert f"summary.json: {name} is not what a run writes" in warned


def test_a_newer_version_is_said(run: Path) -> None:
    summary = json.loads((run / "summary.json").read_text(encoding="utf-8"))
    summary |= {"format": 99, "unheard_of": 1}
    summary["versions"]["tolevo"] = "1000.1"
    (run / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    _, warned = rebuilt(run)
    assert "summary.json: was written by a newer version (1000.1, format 99" in warned


def test_choices_of_points_that_are_gone_are_left_out(run: Path) -> None:
    front = (run / "front.csv").read_text(encoding="utf-8").splitlines()
    (run / "front.csv").write_text("\n".join(front[:3]) + "\n", encoding="utf-8")
    _, warned = rebuilt(run)
    assert "choices.csv: names points that front.csv does not have (2 rows)" in warned


def test_a_table_that_is_none(run: Path) -> None:
    (run / "choices.csv").write_bytes(b"\xff\xfe")
    (run / "references.csv").write_text('a,b\n"1\n', encoding="utf-8")
    _, warned = rebuilt(run)
    assert "choices.csv: is not UTF-8 text" in warned
    assert "references.csv: " in warned


def test_nothing_to_build(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    missing = tolevo("report", tmp_path / "none")
    assert missing.exit_code == 2
    assert "does not exist" in missing.stderr
    empty = tolevo("report", tmp_path / "empty")
    assert empty.exit_code == 2
    assert "holds no result" in empty.stderr
    (tmp_path / "empty" / "summary.json").write_text("{}", encoding="utf-8")
    hollow = tolevo("report", tmp_path / "empty")
    assert hollow.exit_code == 2
    assert "front.csv" in hollow.stderr
    assert "is missing" in hollow.stderr
    assert "Traceback" not in hollow.stderr
    assert [path.name for path in (tmp_path / "empty").iterdir()] == ["summary.json"]


def test_a_study_without_its_page_data_says_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "study.csv").write_text("point\n", encoding="utf-8")
    result = tolevo("report", tmp_path)
    assert result.exit_code == 2
    assert "page.json: is missing" in result.stderr
    assert "run `tolevo study` on it again, with --resume" in result.stderr


def of_a_study(folder: Path) -> None:
    with Database(folder / DATABASE, 2, ()) as database:
        empty = np.empty((0, len(CURVE)))
        database.record([RunRecord(at, 0, 0, "done", "", 1, 0.0, {}, empty) for at in range(2)])


def of_a_reproduction(folder: Path) -> None:
    (folder / "checked").mkdir()
    for number in range(3):
        (folder / "checked" / f"0_{number}.json").write_text("{}", encoding="utf-8")


def of_an_analysis(folder: Path) -> None:
    (folder / "replicates.jsonl").write_text("{}\n" * 5, encoding="utf-8")


def of_nothing(folder: Path) -> None:
    (folder / "config.toml").write_text("seed = 1\n", encoding="utf-8")


@pytest.mark.parametrize(
    ("command", "state", "words"),
    [
        ("study", of_a_study, "2 runs have ended."),
        ("reproduce", of_a_reproduction, "3 claims have been checked."),
        ("gap", of_an_analysis, "4 replicates have ended."),
        ("run", of_nothing, "Nothing has been saved."),
        ("study", of_nothing, "No run has ended."),
    ],
)
def test_an_unfinished_result_is_shown_as_such(
    tmp_path: Path, command: str, state: Callable[[Path], None], words: str
) -> None:
    state(tmp_path)
    write_unfinished(tmp_path, command, "token")
    result = tolevo("report", tmp_path)
    assert result.exit_code == 0, result.stderr
    said = f"this result of `tolevo {command}` is unfinished; run the same command with --resume"
    assert f"manifest.json: is missing: {said}" in result.stderr
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert words in page
    assert f"This result of `tolevo {command}` is unfinished." in page
    compared = tolevo("report", tmp_path, tmp_path / "none", "--out", tmp_path / "c.html")
    assert compared.exit_code == 2


def result(cost: list[float], error: list[float], **summary: object) -> RunResult:
    front = pd.DataFrame({"cost": cost, "error_um": error})
    axes = (Axis("cost", ""), Axis("error_um", "um"))
    return RunResult("t", front, pd.DataFrame(), pd.DataFrame(), summary, axes)


def test_hypervolumes_and_costs_by_hand() -> None:
    """In the box 0..10 by 0..10 with reference 1.1 each: areas of rectangles."""
    box = {"ideal": {"cost": 0.0, "error_um": 0.0}, "nadir": {"cost": 10.0, "error_um": 10.0}}
    runs = {"a": result([1.0, 5.0, 9.0], [9.0, 5.0, 1.0], **box), "b": result([2.0, 9.0], [8.0, 1.0], **box)}
    found, said = compared(runs)
    assert found is not None
    assert said == ()
    table = found.table.set_index("run")
    assert table.loc["a", "hypervolume"] == pytest.approx(1.0 * 0.2 + 0.6 * 0.4 + 0.2 * 0.4)
    assert table.loc["b", "hypervolume"] == pytest.approx(0.9 * 0.3 + 0.2 * 0.7)
    assert found.equal["error_um"].tolist() == pytest.approx(np.linspace(1.0, 8.0, 7).tolist())
    assert found.equal["cost, a"].tolist() == [9.0, 9.0, 9.0, 9.0, 5.0, 5.0, 5.0]
    assert found.equal["cost, b"].tolist() == [9.0] * 6 + [2.0]


def test_different_boxes_are_joined_and_said() -> None:
    one = {"ideal": {"cost": 0.0, "error_um": 0.0}, "nadir": {"cost": 1.0, "error_um": 1.0}}
    two = {"ideal": {"cost": 0.0, "error_um": 0.0}, "nadir": {"cost": 10.0, "error_um": 10.0}}
    found, _ = compared({"a": result([1.0], [1.0], **one), "b": result([1.0], [1.0], **two)})
    assert found is not None
    assert found.table["hypervolume"].tolist() == pytest.approx([1.0, 1.0])
    assert "different boxes" in found.notes[0]


def test_other_objectives_are_left_out() -> None:
    other = RunResult("t", pd.DataFrame({"mass": [1.0]}), pd.DataFrame(), pd.DataFrame(), {},
                      (Axis("mass", "kg"),))  # fmt: skip
    found, said = compared({"a": result([1.0], [1.0]), "b": other})
    assert found is None
    assert said == ("b: minimises mass, and a cost, error_um: left out",)


def test_several_directories(run: Path, whole: Path, tmp_path: Path) -> None:
    (run / "convergence.csv").unlink()
    out = tmp_path / "c.html"
    result = tolevo("report", whole, run, tmp_path / "none", "--out", out)
    assert result.exit_code == 0, result.stderr
    assert f"{run}/convergence.csv: is missing" in result.stderr
    assert "none: does not exist" in result.stderr
    text = out.read_text(encoding="utf-8")
    assert "Cost at equal value" in text
    alone = tolevo("report", whole, tmp_path / "none", "--out", out)
    assert alone.exit_code == 2
    assert "fewer than two runs" in alone.stderr
