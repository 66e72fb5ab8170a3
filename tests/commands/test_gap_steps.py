"""Measurements in steps: named by the lattice that they are on, and by nothing else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo.commands.gap import gap
from tolevo.commands.gap.configuration import read_gap
from tolevo.commands.gap.read import read_data
from tolevo.commands.gap.records import GapResult

TABLE = """model = "table"
[columns]
"torque" = { role = "torque", unit = "N m" }
"te" = { role = "measured", unit = "arcsec" }
"te_predicted" = { role = "predicted", unit = "arcsec" }
[settings]
simulations = 400
"""
N, NOISE, SHARE = 300, 0.5, 0.03
RNG = np.random.default_rng(8)
TORQUE = RNG.uniform(-800.0, 800.0, N)
PREDICTED = 0.3 * TORQUE
READ = PREDICTED + 1.7 + RNG.normal(0.0, NOISE, N)
"""The instrument's zero and noise, before it rounds."""


def found(folder: Path, te: np.ndarray) -> GapResult:
    (folder / "gap.toml").write_text(TABLE, encoding="utf-8")
    frame = pd.DataFrame({"torque": TORQUE, "te": te, "te_predicted": PREDICTED})
    frame.to_csv(folder / "data.csv", index=False)
    plan = read_gap(folder / "gap.toml")
    return gap.analysis_result(plan, read_data(plan, folder / "data.csv"))


def stepped(values: np.ndarray, step: float) -> np.ndarray:
    return step * np.round(values / step)


@pytest.mark.parametrize("step", [6.283, 31.4])
def test_steps_are_named_as_they_are(tmp_path: Path, step: float) -> None:
    """Eighty steps over the range, or sixteen: neither is on any grid."""
    result = found(tmp_path, stepped(READ, step))
    assert [one.name for one in result.effects] == ["quantisation"]
    (number,) = result.effects[0].parameters
    assert number.value == pytest.approx(step, rel=1e-9)
    assert any(note.startswith(f"te is measured in steps of {step:.4g}") for note in result.notes)


def test_steps_do_not_hide_an_effect(tmp_path: Path) -> None:
    result = found(tmp_path, stepped(READ + SHARE * TORQUE, 6.283))
    names = {one.name for one in result.effects}
    assert names == {"quantisation", "torsional_compliance"}
    other = next(one for one in result.effects if one.name == "torsional_compliance")
    assert other.parameters[0].value == pytest.approx(SHARE, rel=0.05)


def test_readings_on_no_lattice_are_not_called_rounded(tmp_path: Path) -> None:
    """The model rounds, the instrument does not: the gap is a staircase, its cause another one."""
    result = found(tmp_path, READ + stepped(PREDICTED, 31.4) - PREDICTED)
    assert result.verdict == "unnamed" or not result.effects
    assert "quantisation" not in result.summary["library"]


def test_decimals_are_no_gap(tmp_path: Path) -> None:
    result = found(tmp_path, np.round(READ, 2))
    assert result.verdict == "no_gap"
    assert not any("steps" in note for note in result.notes)
