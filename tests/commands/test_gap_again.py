"""The corrected configuration, analysed again with the same data, has no gap."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from tolevo import registry
from tolevo.cli import app
from tolevo.commands.gap import gap
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.read import read_data

pytestmark = pytest.mark.usefixtures("without_figures")

TABLE = """model = "table"
[columns]
"torque" = { role = "torque", unit = "N m" }
"way" = { role = "direction" }
"te" = { role = "measured", unit = "arcsec" }
"te_predicted" = { role = "predicted", unit = "arcsec" }
"""


def of_table(rng: np.random.Generator) -> pd.DataFrame:
    n = 200
    frame = pd.DataFrame({"torque": rng.uniform(-1.0, 1.0, n), "way": rng.choice([-1.0, 1.0], n)})
    frame["te_predicted"] = rng.normal(size=n)
    frame["te"] = frame["te_predicted"] + 1.5 * frame["way"] + rng.normal(size=n)
    return frame


def of_batch(rng: np.random.Generator) -> pd.DataFrame:
    """Units whose backlash grows with the temperature."""
    n = 150
    table = {"unit": np.arange(n).astype(str), "temperature_C": rng.uniform(20.0, 40.0, n)}
    model = registry.load("models", "rv_batch")({"model": "document"})
    drawn = model.predict(table, np.random.default_rng(4))["backlash_arcmin"]
    more = 0.03 * (table["temperature_C"] - 20.0)
    return pd.DataFrame({**table, "backlash_arcmin": drawn + more})


def of_assembly(rng: np.random.Generator) -> pd.DataFrame:
    """Adjustments that achieve less than is commanded: a weight that does less than it says."""
    n = 80
    table = {f"dtheta_{k}_mrad": rng.normal(0.0, 2.0, n) for k in range(1, 5)}
    table["precision_weight"] = rng.choice([0.0, 5.0, 20.0], n)
    frame = pd.DataFrame({"unit": np.arange(n).astype(str), **table})
    model = registry.load("models", "assembly")()
    given = {name: frame[name].to_numpy() for name in frame}
    changes = {"adjustment_gain_error": np.full(n, -0.3)}
    outputs = model.predict(given, rng, changes)
    for name, values in outputs.items():
        frame[name] = values + rng.normal(0.0, 0.3 * np.std(values), n)
    return frame


CASES = {
    "table": (TABLE, of_table, "friction_hysteresis"),
    "rv_batch": (
        'model = "rv_batch"\nparameters.model = "document"\n[free]\n',
        of_batch,
        "differential_thermal_expansion",
    ),
    "assembly": ('model = "assembly"\n', of_assembly, "adjustment_gain"),
}


@pytest.mark.parametrize("case", CASES)
def test_nothing_is_left_to_be_named(tmp_path: Path, case: str) -> None:
    text, data, name = CASES[case]
    (tmp_path / "gap.toml").write_text(text, encoding="utf-8")
    data(np.random.default_rng(2)).to_csv(tmp_path / "data.csv", index=False)
    words = ["gap", str(tmp_path / "gap.toml"), str(tmp_path / "data.csv"), "--out"]
    ended = CliRunner().invoke(app, [*words, str(tmp_path / "out"), "--quiet"])
    assert ended.exit_code == 0, ended.output
    said = json.loads((tmp_path / "out" / "gap.json").read_text(encoding="utf-8"))
    assert name in [one["name"] for one in said["effects"]]
    plan = read_gap(tmp_path / "out" / "corrected.toml")
    again = gap.analysis_result(plan, read_data(plan, tmp_path / "data.csv"))
    assert again.verdict == "no_gap", [str(one) for one in again.effects]
    assert [one["name"] for one in said["effects"]] == [one.effect.name for one in plan.active]
    for output, before in again.gap_before.items():
        floor = again.noise_floor[output]
        assert before < 1.1 * floor
