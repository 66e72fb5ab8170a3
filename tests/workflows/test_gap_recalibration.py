"""A recalibration that goes far is said: it may have hidden a cause."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo import registry
from tolevo.configuration.gap import read_gap
from tolevo.workflows.gap import gap
from tolevo.workflows.gap.read import read_data
from tolevo.workflows.gap.recalibration import said

STIFFNESS = "series_stiffness_Nm_per_arcmin"
CONFIGURATION = f"""model = "rv_lost_motion"
[free]
{STIFFNESS} = 5.0
[settings]
simulations = 200
"""


@pytest.mark.parametrize(
    ("move", "error", "far"),
    [(0.7, 0.01, True), (-0.7, 0.01, True), (0.4, 0.01, False), (0.7, 0.3, False)],
)
def test_far_is_half_of_the_tolerance_and_no_chance(move: float, error: float, far: bool) -> None:
    text = said([("zero", move, 1.0, error), ("other", 0.0, 1.0, 0.1)])
    assert ("zero" in text) is far
    assert "other" not in text


@pytest.mark.parametrize("share", [0.0, 0.8])
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
    result = gap.found(plan, read_data(plan, tmp_path / "data.csv"))
    noted = any(f"tolerance: {STIFFNESS};" in note for note in result.notes)
    assert noted is (share > 0.0)
