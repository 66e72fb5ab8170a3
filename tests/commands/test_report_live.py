"""Pages of results that are being made: what there is, renewed until it is complete."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tolevo.algorithms.archive import CURVE
from tolevo.cli import app
from tolevo.commands.report import Report, report, watch
from tolevo.commands.study.storage import DATABASE, Database
from tolevo.commands.study.trial import RunRecord
from tolevo.directory.standing import write_unfinished

RENEWS = 'http-equiv="refresh" content="5"'


def ended(folder: Path, *gaps: tuple[int, float]) -> None:
    """Runs of a study that have ended: point of the design and gap."""
    with Database(folder / DATABASE, 2, ("gap_percent",)) as database:
        before = len(database.runs(10**6))
        database.record([
            RunRecord(point, before + at, 0, "done", "", 1, 0.0, {"gap_percent": gap},
                      np.empty((0, len(CURVE))))
            for at, (point, gap) in enumerate(gaps)
        ])  # fmt: skip


def test_an_unfinished_study_shows_its_medians(tmp_path: Path) -> None:
    ended(tmp_path, (0, 1.0), (0, 3.0), (0, 40.0), (1, 0.25))
    write_unfinished(tmp_path, "study", "token")
    found = report([tmp_path])
    page = found.path.read_text(encoding="utf-8")
    assert found.unfinished
    assert "4 runs have ended." in page
    rows = page[page.index("Medians so far") :]
    assert rows.count("<tr>") == 3  # the heading and two points
    assert ">3</td>" in rows and ">0.25</td>" in rows
    assert RENEWS not in page


def test_a_page_is_renewed_until_its_watch_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "s"
    folder.mkdir()
    ended(folder, (0, 1.0))
    write_unfinished(folder, "study", "token")
    waited: list[float] = []

    def pause(seconds: float) -> None:
        """In the meantime a run ends; then somebody ends the watch."""
        waited.append(seconds)
        if len(waited) == 2:
            raise KeyboardInterrupt
        ended(folder, (1, 2.0))

    monkeypatch.setattr("time.sleep", pause)
    seen: list[str] = []

    def told(one: Report) -> None:
        seen.append(one.path.read_text(encoding="utf-8"))

    with pytest.raises(KeyboardInterrupt):
        watch(folder, tmp_path / "s.html", told)
    assert waited == [5.0, 5.0]
    assert "1 runs have ended." in seen[0] and "2 runs have ended." in seen[1]
    assert all(RENEWS in page for page in seen)


def test_faults_of_a_watch_are_named_at_once(tmp_path: Path) -> None:
    told = CliRunner().invoke(app, ["report", str(tmp_path), str(tmp_path / "b"), "--watch",
                                    "--figures", str(tmp_path / "f")])  # fmt: skip
    assert told.exit_code == 2
    assert "--watch: takes one directory, got 2" in told.stderr
    assert "--figures: are drawn when the result is complete" in told.stderr


def test_an_unfinished_gap_shows_what_its_replicates_name(tmp_path: Path) -> None:
    folder = tmp_path / "g"
    folder.mkdir()
    found = [{"number": at, "effects": {"wear": {"slope": 1.0 + at}} if at else {}}
             for at in range(5)]  # fmt: skip
    lines = ['{"whose": "first line"}', *map(json.dumps, found), '{"number": 5, "eff']
    (folder / "replicates.jsonl").write_text("\n".join(lines), encoding="utf-8")
    write_unfinished(folder, "gap", "token")
    page = report([folder], tmp_path / "p.html")
    assert page.unfinished
    text = page.path.read_text(encoding="utf-8")
    assert "Effects in the 5 replicates so far" in text
    assert "wear" in text
    assert "80" in text  # percent of the replicates
    assert "3.5" in text  # median of 2, 3, 4, 5
