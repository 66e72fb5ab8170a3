"""A recalibration that goes far is said: it may have hidden a cause."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo import registry
from tolevo.commands.gap import gap
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.gap import recalibration_message
from tolevo.commands.gap.read import read_data
from tolevo.configuration.reader import build_model, read_table
from tolevo.models.rv_reducer.batch import RvBatch

pytestmark = pytest.mark.usefixtures("unrendered")

STIFFNESS = "series_stiffness_Nm_per_arcmin"
CONFIGURATION = f"""model = "rv_lost_motion"
[free]
{STIFFNESS} = 5.0
[settings]
simulations = 200
"""


@pytest.mark.parametrize(
    ("move", "error", "far"), [(0.7, 0.01, True), (-0.7, 0.01, True), (0.4, 0.01, False), (0.7, 0.3, False)]
)
def test_far_is_half_of_the_tolerance_and_no_chance(move: float, error: float, far: bool) -> None:
    text = recalibration_message([("zero", move, 1.0, error), ("other", 0.0, 1.0, 0.1)])
    assert ("zero" in text) is far
    assert "other" not in text


@pytest.mark.parametrize("share", [pytest.param(0.0, marks=pytest.mark.slow), 0.8])
def test_a_unit_that_is_softer_than_its_model(tmp_path: Path, share: float) -> None:
    """By a share of what is allowed, in torque cycles."""
    phase = np.linspace(0.0, 4.0 * np.pi, 120)
    table = {"torque_Nm": 400.0 * np.sin(phase), "direction": np.where(np.cos(phase) < 0, -1.0, 1)}
    unit = registry.load("models", "rv_lost_motion")({STIFFNESS: 58.5 - share * 5.0})
    rng = np.random.default_rng(3)
    twist = unit.predict(table, rng)["twist_arcmin"]
    twist = twist + rng.normal(0.0, 0.002 * np.std(twist), len(phase))
    frame = pd.DataFrame({**table, "twist_arcmin": twist})
    frame.to_csv(tmp_path / "data.csv", index=False)
    (tmp_path / "gap.toml").write_text(CONFIGURATION, encoding="utf-8")
    plan = read_gap(tmp_path / "gap.toml")
    result = gap.analysis_result(plan, read_data(plan, tmp_path / "data.csv"))
    noted = any(f"tolerance: {STIFFNESS};" in note for note in result.notes)
    assert noted is (share > 0.0)


def test_a_mid_limit_of_a_batch_is_recalibrated_in_its_model(tmp_path: Path) -> None:
    """Pins 2.5 um thicker than drawn: mean and scatter are those of such units, here and in the
    corrected configuration, whose variable has that mid-limit as well.
    """
    made = RvBatch({"model": "document", "pin_radius_mid_um": 1.5})
    units = {"unit": np.arange(400).astype(str)}
    y = made.predict(units, np.random.default_rng(3))["backlash_arcmin"]
    pd.DataFrame({**units, "backlash_arcmin": y}).to_csv(tmp_path / "data.csv", index=False)
    text = 'model = "rv_batch"\n[parameters]\nmodel = "document"\n[free]\npin_radius_mid_um = 5.0\n'
    (tmp_path / "gap.toml").write_text(text, encoding="utf-8")
    plan = read_gap(tmp_path / "gap.toml")
    result = gap.analysis_result(plan, read_data(plan, tmp_path / "data.csv"))
    assert result.verdict == "no_gap"
    (moved,) = result.gate.recalibrated
    assert moved.after == pytest.approx(1.5, abs=0.3)
    corrected = build_model(read_table(tomllib.loads(result.corrected), []))
    assert corrected.means()["backlash_arcmin"] == pytest.approx(y.mean(), abs=0.03)
