"""The UR5 of docs/ur5.md: measured positions by laser tracker, recalibrated.

P. Jacobi, master's thesis, Tsinghua University, 2025 (0.155 mm); data under the MIT licence.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.small_jobs import output_of as tolevo

pytestmark = pytest.mark.usefixtures("without_figures")

DATA = Path(__file__).resolve().parents[1] / "data" / "ur5"
AXES = ["x_mm", "y_mm", "z_mm"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("ur5")
    pd.read_csv(DATA / "grid.csv").iloc[::2].to_csv(place / "few.csv", index=False)
    tolevo("gap", DATA / "ur5.toml", place / "few.csv", "--out", place / "gap", "--quiet",
           "--set", "settings.simulations=200")  # fmt: skip
    return place


def distance(folder: Path, configuration: Path, name: str) -> np.ndarray:
    """Between simulated and measured positions (n,) [mm]."""
    out = folder / f"{configuration.parent.name}_{name}.csv"
    tolevo("simulate", configuration, DATA / f"{name}.csv", "--out", out, "--quiet")
    both = [pd.read_csv(path)[AXES].to_numpy() for path in (out, DATA / f"{name}.csv")]
    return np.asarray(np.linalg.norm(both[0] - both[1], axis=1))


def test_positions_before(folder: Path) -> None:
    """2.63 mm over the whole grid; 250 of its poses scatter about it by 1 %."""
    assert distance(folder, DATA / "ur5.toml", "grid").mean() == pytest.approx(2.63, abs=0.03)


def test_positions_after(folder: Path) -> None:
    """Fitted to every eighth pose of the grid: half of these were not seen."""
    corrected = folder / "gap" / "corrected.toml"
    assert distance(folder, corrected, "grid").mean() <= 0.12
    assert distance(folder, corrected, "test").mean() <= 0.16


def test_nothing_is_named_that_the_data_do_not_hold(folder: Path) -> None:
    """An effect, if any, lowers the error of rows that the fit never saw."""
    said = json.loads((folder / "gap" / "gap.json").read_text())
    assert said["effects"] == [] or said["gap_after"]["total"] < said["gap_before"]["total"]
    assert not any("not used" in note for note in said["notes"])
