"""A run with effects in its model: the front before and after."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tolevo import registry
from tolevo.algorithms.nsga2 import NSGA2
from tolevo.algorithms.settings import Budget
from tolevo.commands.run.plan import RunOutcome, RunPlan
from tolevo.commands.run.run import run
from tolevo.models.effects.measurements import Active
from tolevo.page.figures import pictures
from tolevo.page.page import page
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import Bound, Settings

WARM = Active(registry.load("effects", "differential_thermal_expansion")(), {"temperature_difference_K": 5.0})
BIAS = Active(registry.load("effects", "gauge_bias")(), {"offset_arcmin": 0.1})


def plan(*effects: Active, objectives: tuple[str, ...] = ()) -> RunPlan:
    limits = {"interference_probability": Bound(high=0.9)}
    problem = RvBacklash(Settings(limits=limits, objectives=objectives, effects=effects))
    budget = Budget(generations=15)
    return RunPlan(problem, NSGA2(population=40), budget, 3, False, "# none\n", "test")


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> RunOutcome:
    return run(plan(WARM, BIAS), tmp_path_factory.mktemp("effects") / "a")


@pytest.fixture(scope="module")
def plain(outcome: RunOutcome, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run without effects, in the place of one with them."""
    folder = tmp_path_factory.mktemp("effects") / "a"
    shutil.copytree(outcome.folder, folder)
    assert (folder / "allocation_moved.csv").exists()
    run(plan(), folder)
    return folder


@pytest.mark.slow
def test_front_before_is_that_of_a_run_without_effects(outcome: RunOutcome, plain: Path) -> None:
    before = pd.read_csv(outcome.folder / "front_without_effects.csv")
    front = pd.read_csv(plain / "front.csv")
    pd.testing.assert_frame_equal(before, front[before.columns])


def test_effects_removed_from_a_run_leave_no_file(plain: Path) -> None:
    assert not (plain / "allocation_moved.csv").exists()
    assert not (plain / "front_without_effects.csv").exists()


def test_allocation_moves_by_what_the_effect_does(outcome: RunOutcome) -> None:
    """Kept, a design has up to 0.281 arcmin less backlash: what phi_2 loses and is not cut off."""
    moved = pd.read_csv(outcome.folder / "allocation_moved.csv")
    assert moved["allocation"].tolist() == ["before", "kept", "after"] * 3
    rows = {label: part.reset_index() for label, part in moved.groupby("allocation")}
    before, kept, after = rows["before"], rows["kept"], rows["after"]
    gained = before["backlash_arcmin"] - kept["backlash_arcmin"]
    assert np.all((gained > 0.05) & (gained < 0.2814))
    np.testing.assert_allclose(kept["cost"], before["cost"], rtol=1e-12)
    assert np.all(before["pin_radius_um"] == kept["pin_radius_um"])
    for row in (before, after):
        assert np.all(row["backlash_arcmin"] <= row["level"])
    assert outcome.result.moved is not None


def test_effects_are_told(outcome: RunOutcome) -> None:
    effects = json.loads((outcome.folder / "summary.json").read_text())["effects"]
    assert [one["name"] for one in effects] == ["differential_thermal_expansion", "gauge_bias"]
    assert "phi_2 changes by -0.28" in effects[0]["counterpart"]
    assert effects[1]["counterpart"] is None
    assert effects[1]["parameters"] == {"offset_arcmin": 0.1}
    lines = "\n".join(outcome.lines)
    assert "effect gauge_bias has no counterpart in this problem" in lines
    assert "phi_2 changes by" in lines


def test_page_and_figure_show_both(outcome: RunOutcome) -> None:
    text = (outcome.folder / "report.html").read_text()
    assert "The change of the allocation by the effects in the model" in text
    assert "<h2>Effects</h2>" in text
    without = replace(outcome.result, before=None, moved=None)
    assert "<h2>Effects</h2>" not in page(without)
    drawn = (outcome.folder / "front.svg").read_bytes()
    assert drawn == pictures(outcome.result)["front.svg"]
    assert len(drawn) > len(pictures(without)["front.svg"])


def test_effects_that_do_nothing_cost_no_second_search(tmp_path: Path) -> None:
    found = run(plan(BIAS), tmp_path / "a")
    assert not (found.folder / "front_without_effects.csv").exists()
    assert found.result.before is None


def test_one_objective_moves_from_point_to_point(tmp_path: Path) -> None:
    limits = {"interference_probability": Bound(high=0.9), "backlash_arcmin": Bound(high=1.5)}
    problem = RvBacklash(Settings(limits=limits, objectives=("cost",), effects=(WARM,)))
    budget = Budget(generations=10)
    found = run(RunPlan(problem, NSGA2(population=40), budget, 3, False, "", "test"), tmp_path / "a")
    moved = found.result.moved
    assert moved is not None
    assert moved["allocation"].tolist() == ["before", "kept", "after"]
