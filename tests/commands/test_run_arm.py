"""`tolevo run`, `evaluate` and `simulate` of a serial arm."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.small_jobs import output_of as tolevo

CONFIG = Path(__file__).resolve().parents[2] / "configs" / "robot_arm.toml"
pytestmark = [pytest.mark.source_tree, pytest.mark.usefixtures("unrendered")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("arm")
    tolevo("run", CONFIG, "--out", place / "run", "--quiet", "--set", "algorithm.points=6",
           "--set", "propagation.samples=2048")  # fmt: skip
    return place


def test_front(folder: Path) -> None:
    front = pd.read_csv(folder / "run" / "front.csv")
    assert len(front) == 6
    assert np.all(front["bound"] <= front["cost"]) and front["gap_percent"].max() <= 1e-3
    shares = [name for name in front.columns if str(name).startswith("share_")]
    np.testing.assert_allclose(front[shares].sum(axis=1), 100.0)
    assert np.all(front["wind_up_mm"] > front["wind_up_varying_mm"])


def test_summary_and_page(folder: Path) -> None:
    summary = json.loads((folder / "run" / "summary.json").read_text())
    named = {one["name"] for one in summary["assumptions"]}
    assert {"cell", "reducers.1", "joint[3].reducer.backlash_factor"} <= named
    labels = [one["label"] for one in summary["alternatives"]]
    assert labels == ["reducers alike in all drives", "calibrated in position"]
    assert [one["more_percent"] > 0.0 for one in summary["alternatives"]] == [True, False]
    assert sum(p["share"] for p in summary["machine"]["parts"]) == pytest.approx(100.0, abs=0.1)
    page = (folder / "run" / "report.html").read_text()
    assert page.count("<title>link ") == 6 and page.count("<title>joint ") == 6


def test_resolved_configuration_evaluates_the_front(folder: Path) -> None:
    tolevo("evaluate", folder / "run" / "config.toml", folder / "run" / "front.csv", "--out",
           folder / "evaluated.csv", "--quiet")  # fmt: skip
    first, second = (pd.read_csv(folder / name) for name in ("run/front.csv", "evaluated.csv"))
    for name in ("pose_rms_mm", "cost", "pose_accuracy_mm", "squareness_mrad"):
        np.testing.assert_allclose(first[name], second[name], rtol=1e-12)


def test_simulate_takes_the_same_configuration(folder: Path) -> None:
    """All joints at 0: the chain stretched out, 180 + 600 + 120 mm from the axis."""
    table = pd.DataFrame({f"joint_{joint}_deg": [0.0] for joint in range(1, 7)})
    table.to_csv(folder / "zero.csv", index=False)
    tolevo("simulate", CONFIG, folder / "zero.csv", "--out", folder / "at.csv", "--quiet")
    found = pd.read_csv(folder / "at.csv").iloc[0]
    assert [found["x_mm"], found["y_mm"], found["z_mm"]] == pytest.approx([900.0, 0.0, 400.0 - 620.0 - 115.0])
