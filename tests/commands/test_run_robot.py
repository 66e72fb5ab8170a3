"""`tolevo run` of the whole machine: front, bounds, kept fronts, and the same again."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.small_jobs import output_of as tolevo
from tolevo.configuration.reader import read
from tolevo.problems.nested_reducers import Nested, documents_reducer
from tolevo.problems.robot_joint import RobotJoint

ROOT = Path(__file__).resolve().parents[2]
CONFIG = ROOT / "configs" / "robot_manipulator.toml"
pytestmark = [pytest.mark.source_tree, pytest.mark.usefixtures("unrendered")]
FEW = ("--set", "algorithm.points=4", "--set", "propagation.samples=8192", "--quiet")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("robot")
    tolevo("run", CONFIG, "--out", place / "run", *FEW)
    return place


def test_front_with_bounds(folder: Path) -> None:
    front = pd.read_csv(folder / "run" / "front.csv")
    assert len(front) == 4
    assert np.all(front["bound"] <= front["cost"])
    assert front["gap_percent"].max() <= 1e-3
    np.testing.assert_allclose(front["cost"], front["cost_links"] + front["cost_reducers"])
    np.testing.assert_allclose(front["pose_accuracy_mm"], front["accuracy_ratio"] * front["pose_rms_mm"])
    shares = [name for name in front.columns if str(name).startswith("share_")]
    np.testing.assert_allclose(front[shares].sum(axis=1), 100.0)


@pytest.mark.parametrize("at", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_least_cost_at_the_accuracy_of_a_point_of_the_front(folder: Path, at: int) -> None:
    """Accuracy is not in proportion to the rms error that is solved for: as cheap as the point of the front."""
    point = pd.read_csv(folder / "run" / "front.csv").iloc[at]
    more = ('objectives.minimise=["cost"]', f"limits.pose_accuracy_mm={float(point['pose_accuracy_mm'])!r}")
    told = tolevo("run", CONFIG, "--out", folder / f"least{at}", *FEW, *(w for key in more for w in ("--set", key)))
    (least,) = pd.read_csv(folder / f"least{at}" / "front.csv").to_dict("records")
    assert least["pose_accuracy_mm"] <= point["pose_accuracy_mm"] * (1.0 + 1e-9)
    assert least["cost"] <= point["cost"] * (1.0 + 1e-3)
    assert "Proven: this is the least cost within the limits at equal pose rms (" in told
    assert not (folder / f"least{at}" / "requirements.csv").exists()  # its form leaves the accuracy out


def test_summary_names_what_is_assumed(folder: Path) -> None:
    summary = json.loads((folder / "run" / "summary.json").read_text())
    named = {one["name"] for one in summary["assumptions"]}
    assert {"reducers.1", "parameters.payload_kg", "parameters.friction_torque_Nm",
            "parameters.precision_weight", "costs.origin_1_um"} <= named  # fmt: skip
    assert "proven fronts of the reducers" in summary["bound_form"]
    (note,) = [one for one in summary["notes"] if "a further unit of cost" in one]
    assert "joint_1" in note  # the largest share


def test_what_else_would_cost_and_where_the_error_is_made(folder: Path) -> None:
    """Reducers alike are as cheap by symmetry; the parts of the picture make the whole error."""
    summary = json.loads((folder / "run" / "summary.json").read_text())
    alike, calibrated = summary["alternatives"]
    assert alike["label"] == "reducers alike in all drives"
    assert alike["more_percent"] == pytest.approx(0.0, abs=1e-4)
    assert calibrated["more_percent"] < -10.0
    assert sum(part["share"] for part in summary["machine"]["parts"]) == pytest.approx(100.0, abs=0.1)
    page = (folder / "run" / "report.html").read_text()
    assert "Where the error is made" in page
    assert page.count("<title>arm ") == 3 and page.count("<title>joint ") == 2


def test_resolved_configuration_gives_the_same_front(folder: Path) -> None:
    tolevo("run", folder / "run" / "config.toml", "--out", folder / "again", "--quiet")
    first, second = ((folder / name / "front.csv").read_bytes() for name in ("run", "again"))
    assert first == second


def test_fronts_of_reducers_are_kept(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One front for two drives that are alike; taken from the file where it is the same reducer."""
    with np.load(folder / "run" / "reducers.npz") as stored:
        arrays = {name: stored[name] for name in stored.files}
    assert len({name.split(".")[0] for name in arrays}) == 1
    problem = documents_reducer().problem
    robot = read(CONFIG).problem
    assert isinstance(robot, RobotJoint)
    documents_reducer().cost(np.array([0.5]))  # its own front
    own = Nested("robot_reducer.toml", robot.definition.reducers[0].tables, problem)
    other = Nested("another", {"problem": "rv_backlash"}, problem)
    monkeypatch.setattr("tolevo.problems.nested_reducers._curve", None)  # nothing is worked out
    assert not other.adopt(arrays)
    assert own.adopt(arrays)
    rms = np.array([0.4, 0.7, 1.5])
    np.testing.assert_allclose(own.cost(rms), documents_reducer().cost(rms), rtol=1e-12)


def test_least_cost_at_an_accuracy(folder: Path) -> None:
    """One optimum with a limit on A: kept by the Monte Carlo of the point itself."""
    tolevo("run", CONFIG, "--out", folder / "least", *FEW, "--set", 'objectives.minimise=["cost"]',
           "--set", "limits.pose_accuracy_mm=0.15")  # fmt: skip
    front = pd.read_csv(folder / "least" / "front.csv")
    assert len(front) == 1
    row = front.iloc[0]
    assert 0.1497 < row["pose_accuracy_mm"] <= 0.15
    assert row["gap_percent"] < 1e-3
    assert row["cost"] == pytest.approx(66.13, rel=0.02)


def test_evaluate_takes_the_front(folder: Path) -> None:
    tolevo("evaluate", folder / "run" / "config.toml", folder / "run" / "front.csv", "--out",
           folder / "evaluated.csv", "--quiet")  # fmt: skip
    first, second = (pd.read_csv(folder / name) for name in ("run/front.csv", "evaluated.csv"))
    np.testing.assert_allclose(first["pose_rms_mm"], second["pose_rms_mm"], rtol=1e-12)
    np.testing.assert_allclose(first["cost"], second["cost"], rtol=1e-12)
