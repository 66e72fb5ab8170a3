"""Whether what was named does anything in the problem whose allocation is to be repeated."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from tolevo import registry
from tolevo.cli import app
from tolevo.configuration.reader import read

pytestmark = pytest.mark.usefixtures("without_figures")

SHIFT = 0.4
"""[arcmin]"""


@pytest.mark.parametrize(
    ("never", "name", "does"),
    [
        ("", "process_mean_shift", "every unit's backlash"),
        ('[effects]\nnever = ["process_mean_shift"]\n', "gauge_bias", ""),
    ],
)
def test_a_shifted_batch(tmp_path: Path, never: str, name: str, does: str) -> None:
    """A gauge that is off moves no allocation; a process that is off does."""
    n = 150
    model = registry.load("models", "rv_batch")({"model": "document"})
    units = np.arange(n).astype(str)
    drawn = model.predict({"unit": units}, np.random.default_rng(11))["backlash_arcmin"]
    frame = pd.DataFrame({"unit": units, "backlash_arcmin": drawn + SHIFT})
    frame.to_csv(tmp_path / "units.csv", index=False)
    (tmp_path / "run.toml").write_text('problem = "rv_backlash"\n', encoding="utf-8")
    text = f'model = "rv_batch"\nparameters.model = "document"\nrun = "run.toml"\n[free]\n{never}'
    (tmp_path / "gap.toml").write_text(text, encoding="utf-8")
    words = ["gap", str(tmp_path / "gap.toml"), str(tmp_path / "units.csv"), "--out"]
    ended = CliRunner().invoke(app, [*words, str(tmp_path / "out"), "--quiet"])
    assert ended.exit_code == 0, ended.output
    said = json.loads((tmp_path / "out" / "gap.json").read_text(encoding="utf-8"))
    (effect,) = said["effects"]
    problem = read(tmp_path / "out" / "corrected.toml").problem
    assert problem is not None
    assert effect["name"] == name
    assert effect["in_problem"] is bool(does)
    told = does or "no counterpart in rv_backlash: the allocation does not change"
    assert effect["counterpart"].startswith(told)
    assert [bool(one) for one in problem.counterparts()] == [bool(does)]
    printed = " ".join(ended.output.split())
    assert f"in the problem: {name}: {told}" in printed
    assert told.replace("'", "&#x27;") in (tmp_path / "out" / "report.html").read_text("utf-8")
