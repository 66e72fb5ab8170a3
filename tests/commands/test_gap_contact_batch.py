"""Units by contact: a shifted pin circle is named, attributed, and goes into rv_reducer."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from tolevo.cli import app
from tolevo.configuration.reader import read
from tolevo.models.rv_reducer.batch import RvBatch
from tolevo.problems.rv_reducer import RvReducer

pytestmark = pytest.mark.usefixtures("without_figures")

SHIFT = 3.0
"""[um] of the pin circle's radius: one half-width, about 0.23'."""
RUN = """problem = "rv_reducer"
[parameters]
search_units = 64
report_units = 256
[limits]
interference_probability = 0.5
"""


def analysed(folder: Path, shift: float, n: int = 200) -> dict[str, Any]:
    """What is found in units whose pin circles are wider by `shift`."""
    table = {"unit": np.arange(n)}
    by = {"pin_circle_radius_um": np.full(n, shift)}
    drawn = RvBatch().predict(table, np.random.default_rng(11), by)["backlash_arcmin"]
    frame = pd.DataFrame({"unit": table["unit"], "backlash_arcmin": drawn})
    frame.to_csv(folder / "units.csv", index=False)
    (folder / "run.toml").write_text(RUN, encoding="utf-8")
    text = 'model = "rv_batch"\nrun = "run.toml"\n[free]\n[settings]\nsimulations = 200\n'
    (folder / "gap.toml").write_text(text, encoding="utf-8")
    words = ["gap", str(folder / "gap.toml"), str(folder / "units.csv"), "--out"]
    ended = CliRunner().invoke(app, [*words, str(folder / "out"), "--quiet"])
    assert ended.exit_code == 0, ended.output
    found: dict[str, Any] = json.loads((folder / "out" / "gap.json").read_text(encoding="utf-8"))
    return found


def test_units_of_the_model_have_no_gap(tmp_path: Path) -> None:
    assert analysed(tmp_path, 0.0)["verdict"] == "no_gap"


@pytest.mark.slow
def test_wider_pin_circle(tmp_path: Path) -> None:
    """A shift of any error looks alike; that of the pin circle is among them, with its amount."""
    said = analysed(tmp_path, SHIFT)
    effect = said["effects"][0]
    assert effect["name"] == "process_mean_shift"
    assert effect["in_problem"]
    shifted = [one for one in said["attribution"] if one["kind"] == "shift"]
    assert any("pin_circle_radius_um" in one["inputs"] for one in shifted)
    assert "the derivative of the mean on the contact" in shifted[0]["text"]
    circle = next(one for one in shifted[0]["candidates"]
                  if one["input"] == "pin_circle_radius_um")  # fmt: skip
    assert circle["low"] < SHIFT < circle["high"]
    problem = read(tmp_path / "out" / "corrected.toml").problem
    assert isinstance(problem, RvReducer)
    assert "every unit's backlash changes by +0.2" in problem.counterparts()[0]
    design = problem.references()["document B"]
    name = "backlash_max_arcmin"
    moved = problem.evaluation(design, searching=True).value(name)
    plain = problem.without_effects().evaluation(design, searching=True).value(name)
    (one,) = problem.settings.effects
    amount = dict(one.values)["shift_arcmin"]
    np.testing.assert_allclose(moved - plain, amount, rtol=1e-9)


def test_readings_at_angles_are_refused(tmp_path: Path) -> None:
    frame = pd.DataFrame({"unit": np.repeat(np.arange(20), 2), "output_angle_deg": [0.0, 90.0] * 20})
    frame.assign(backlash_arcmin=np.linspace(0.4, 1.0, 40)).to_csv(tmp_path / "u.csv", index=False)
    (tmp_path / "gap.toml").write_text('model = "rv_batch"\n[free]\n', encoding="utf-8")
    words = ["gap", str(tmp_path / "gap.toml"), str(tmp_path / "u.csv"), "--out"]
    ended = CliRunner().invoke(app, [*words, str(tmp_path / "out"), "--quiet"])
    assert ended.exit_code == 2
    assert "column output_angle_deg: a batch is compared by one measurement of each unit" in " ".join(
        ended.output.split()
    )
    assert not (tmp_path / "out").exists()
