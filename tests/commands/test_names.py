"""Names, descriptions and drawings of mechanisms in analyses and studies: read, kept, shown."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tolevo.cli import app
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.study.configuration import read_study
from tolevo.configuration.reader import read
from tolevo.errors import InputError

pytestmark = pytest.mark.usefixtures("unrendered")

NAMED = 'name = "Wrist <joint>"\ndescription = "second of six"\ndrawing = "J2-100"\n'
LINE = "mechanism Wrist <joint> (drawing J2-100): second of six"
TABLE = """model = "table"
[settings]
simulations = 200
[columns]
torque = { role = "torque", unit = "N m" }
way = { role = "direction" }
te = { role = "measured", unit = "arcsec" }
te_predicted = { role = "predicted", unit = "arcsec" }
"""
RUN = """problem = "pose_accuracy"
[parameters]
index = "rms_plane"
[objectives]
minimise = ["cost"]
[limits]
squareness_mrad = 0.2
[algorithm]
name = "ga"
population = 8
generations = 2
"""
STUDY = 'run = "run.toml"\nseeds = 2\n[design]\nkind = "factorial"\n[vary]\n' \
        '"algorithm.population" = [6, 8]\n'  # fmt: skip


def called(*words: str) -> str:
    ended = CliRunner().invoke(app, [*words, "--quiet"])
    assert ended.exit_code == 0, ended.output
    return ended.output


def shown(folder: Path) -> str:
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "<h1>Wrist &lt;joint&gt;</h1>" in page
    assert "(drawing J2-100): second of six" in page
    return page


def test_of_an_analysis(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    rows = ["torque,way,te_predicted,te"]
    for torque, way, said, noise in zip(rng.uniform(-1.0, 1.0, 80), rng.choice([-1.0, 1.0], 80),
                                        rng.normal(size=80), rng.normal(size=80),
                                        strict=True):  # fmt: skip
        rows.append(f"{torque:.6f},{way:.0f},{said:.6f},{said + 1.5 * way + noise:.6f}")
    (tmp_path / "data.csv").write_text("\n".join(rows), encoding="utf-8")
    (tmp_path / "gap.toml").write_text(NAMED + TABLE, encoding="utf-8")
    out = tmp_path / "out"
    told = called("gap", str(tmp_path / "gap.toml"), str(tmp_path / "data.csv"), "--out", str(out))
    assert LINE in told.splitlines()
    found = json.loads((out / "gap.json").read_text(encoding="utf-8"))
    known = {"name": "Wrist <joint>", "description": "second of six", "drawing": "J2-100"}
    assert found["mechanism"] == known
    shown(out)
    for name in ("config.toml", "corrected.toml"):
        assert tomllib.loads((out / name).read_text(encoding="utf-8")).items() >= known.items()
    corrected = read(out / "corrected.toml")
    assert corrected.settings.labels.stated() == known
    assert read_gap(out / "corrected.toml").labels.stated() == known


def test_of_the_run_that_an_analysis_repeats(tmp_path: Path) -> None:
    (tmp_path / "run.toml").write_text(NAMED + RUN, encoding="utf-8")
    analysis = tmp_path / "gap.toml"
    analysis.write_text('model = "manipulator_pose"\nrun = "run.toml"\n', encoding="utf-8")
    assert read_gap(analysis).labels.drawing == "J2-100"
    assert read_gap(analysis).run["drawing"] == "J2-100"
    assert read_gap(analysis, ["name=Own"]).labels.stated() == {"name": "Own"}


def test_of_a_study(tmp_path: Path) -> None:
    (tmp_path / "run.toml").write_text(NAMED + RUN, encoding="utf-8")
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    out = tmp_path / "out"
    told = called("study", str(tmp_path / "study.toml"), "--out", str(out), "--workers", "1")
    assert LINE in told.splitlines()
    shown(out)
    assert json.loads((out / "study.json").read_text())["mechanism"]["drawing"] == "J2-100"
    again = read_study(out / "config.toml")
    assert again.settings.labels == read_study(tmp_path / "study.toml").settings.labels
    own = read_study(tmp_path / "study.toml", ["name=Operators", "drawing=S-1"]).settings
    assert own.title == "Operators" and 'drawing = "S-1"' in own.configuration


@pytest.mark.parametrize("text", [TABLE, 'model = "rv_batch"\n'])
def test_a_name_is_text(text: str, tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text("name = 3\ndrawing = 4.5\n" + text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_gap(tmp_path / "c.toml")
    assert [one.place for one in caught.value.faults] == ["name", "drawing"]
