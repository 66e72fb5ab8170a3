"""`run` from a plan to its files."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tolevo
from tolevo.algorithms.ga import GA
from tolevo.algorithms.nsga2 import NSGA2
from tolevo.algorithms.settings import AlgorithmSettings, Budget
from tolevo.commands.run import references
from tolevo.commands.run.front import join_references, knee
from tolevo.commands.run.plan import RunOutcome, RunPlan
from tolevo.commands.run.references import gains, relaxed_bounds
from tolevo.commands.run.run import run
from tolevo.directory import KINDS, MANIFEST
from tolevo.page_data import table_files
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import Bound, PropagationSetting, Settings, VariableSetting
from tolevo.records import RunResult

pytestmark = pytest.mark.usefixtures("unrendered")

FILES = {
    "front.csv", "front.parquet", "front.json", "references.csv", "convergence.csv",
    "summary.json", "config.toml", "report.html", "front.png", "front.svg",
    "checkpoint.npz", "choices.csv", "choice_sensitivity.csv", "allocation.csv", "allocation.xlsx",
    "contributions.csv", "manifest.json", "requirements.csv", "drivers.csv", "prices.csv", "changes.csv",
    "relaxed.csv", "tolerances.json", "drawing.html",
}  # fmt: skip
NEAR = {"dr_rp_mm": VariableSetting(low=-0.05, high=-0.03), "dr_p_mm": VariableSetting(low=-0.09, high=-0.06)}


def plan(
    settings: Settings,
    algorithm: AlgorithmSettings | None = None,
    seed: int = 0,
    generations: int = 25,
    references: bool = False,
) -> RunPlan:
    algorithm = algorithm or NSGA2(population=40)
    budget = Budget(generations=generations)
    return RunPlan(RvBacklash(settings), algorithm, budget, seed, references, "# none\n", "test")


def limited(interference: float = 0.5, **more: Bound) -> Settings:
    limits = {"interference_probability": Bound(high=interference)} | more
    return Settings(limits=limits, variables=NEAR)


@pytest.fixture(scope="module", autouse=True)
def short_reference() -> Iterator[None]:
    """The GA beside the exact reference has fewer generations."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(references, "GA_BUDGET", Budget(generations=30))
        yield


def referenced() -> RunPlan:
    """A short run with references."""
    return plan(limited(), NSGA2(population=16), generations=8, references=True)


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> RunOutcome:
    return run(referenced(), tmp_path_factory.mktemp("run") / "a", workers=1)


def test_all_files_of_the_contract(outcome: RunOutcome) -> None:
    assert {path.name for path in outcome.folder.iterdir()} == FILES
    assert outcome.status == "done"


def test_front_is_feasible_and_nondominated(outcome: RunOutcome) -> None:
    front = pd.read_csv(outcome.folder / "front.csv")
    margins = front.filter(like="margin_")
    assert margins.shape[1] == 6
    assert np.all(margins >= 0.0)
    assert np.all(np.diff(front["cost"]) > 0.0)
    assert np.all(np.diff(front["backlash_arcmin"]) < 0.0)
    assert front["knee"].sum() == 1
    assert front["involute_grade"].dtype == np.int64


def test_front_is_what_evaluation_gives(outcome: RunOutcome) -> None:
    front = pd.read_csv(outcome.folder / "front.csv")
    problem = RvBacklash(limited())
    again = problem.frame(front[problem.names].to_numpy())
    for output in problem.outputs:
        np.testing.assert_allclose(front[output.name], again[output.name], rtol=1e-6, atol=1e-8)


def test_no_admissible_reference_dominates(outcome: RunOutcome) -> None:
    front = pd.read_csv(outcome.folder / "front.csv")
    references = pd.read_csv(outcome.folder / "references.csv")
    for _, row in references[references["feasible"]].iterrows():
        better = (row["cost"] <= front["cost"]) & (row["backlash_arcmin"] < front["backlash_arcmin"])
        assert not better.any(), row["label"]
    assert references["feasible"].sum() == 2
    assert references["label"].tolist()[0] == "document B"


def test_broken_limits_are_named_and_relaxed(outcome: RunOutcome) -> None:
    row = pd.read_csv(outcome.folder / "references.csv").iloc[1].to_dict()
    assert row["violated_limits"] == "interference_probability"
    own = row["interference_probability"]
    assert own > 0.6
    bounds = relaxed_bounds(RvBacklash(limited()), row)
    assert bounds == {"interference_probability": Bound(high=own)}
    assert {"relaxed_cost_saving_percent", "relaxed_backlash_arcmin_gain_percent"} <= set(row)


def test_tables_agree(outcome: RunOutcome) -> None:
    front = pd.read_csv(outcome.folder / "front.csv")
    pd.testing.assert_frame_equal(front, pd.read_parquet(outcome.folder / "front.parquet"), check_exact=True)
    rows = json.loads((outcome.folder / "front.json").read_text())
    assert [row["cost"] for row in rows] == front["cost"].tolist()


def test_summary(outcome: RunOutcome) -> None:
    summary = json.loads((outcome.folder / "summary.json").read_text())
    assert summary["status"] == "done"
    assert summary["evaluations"] == 128
    assert summary["seed"] == 0
    names = {a["name"] for a in summary["assumptions"]}
    assert "references.eccentricity_um" in names
    convergence = pd.read_csv(outcome.folder / "convergence.csv")
    assert convergence["evaluations"].tolist() == list(range(16, 129, 16))
    assert summary["hypervolume"] == pytest.approx(convergence["hypervolume"].iloc[-1])


def test_workers_change_nothing(outcome: RunOutcome, tmp_path: Path) -> None:
    run(referenced(), tmp_path / "b", workers=2)
    for name in ("front.csv", "references.csv"):
        assert (tmp_path / "b" / name).read_bytes() == (outcome.folder / name).read_bytes()


def test_single_objective_run(tmp_path: Path) -> None:
    settings = limited(backlash_arcmin=Bound(high=1.5))
    one = Settings(variables=NEAR, limits=settings.limits, objectives=("cost",))
    found = run(plan(one, GA(population=30)), tmp_path / "a")
    assert len(found.result.front) == 1
    assert found.result.front["backlash_arcmin"][0] <= 1.5


@pytest.mark.parametrize("method", ["moments", pytest.param("monte_carlo", marks=pytest.mark.slow)])
def test_reported_points_are_by_convolution(method: str, tmp_path: Path) -> None:
    propagation = PropagationSetting(method=method, samples=2048)
    settings = Settings(limits=limited().limits, variables=NEAR, propagation=propagation)
    found = run(plan(settings, NSGA2(population=20), generations=8), tmp_path / "a")
    front, problem = found.result.front, RvBacklash(limited())
    again = problem.frame(front[problem.names].to_numpy())
    np.testing.assert_allclose(front["backlash_arcmin"], again["backlash_arcmin"], rtol=1e-9)


def test_where_nothing_was_searched_the_tightest_tolerances_are_the_nearest_miss(tmp_path: Path) -> None:
    """0.7 times a normal deviation of at least 0.0111 mm within 0.0203 mm: P(|z| < 2.6104) = 99.10 % < 99.73 %."""
    machines = [{"name": "old", "sigma": 0.05, "price": 2.0}, {"name": "best", "sigma": 0.01111, "price": 9.0}]
    screw = {"name": "screw", "nominal": 20.0, "unit": "mm", "sensitivity": -0.7, "machine": machines}
    pin = {"name": "pin", "nominal": 9.0, "unit": "mm", "t_min": 0.01, "t_max": 0.1,
           "sensitivity": {"other": 1.0}, "cost": {"model": "reciprocal", "a": 1.0, "b": 0.1}}  # fmt: skip
    table = {
        "problem": "stack", "objectives": {"minimise": ["cost"]}, "algorithm": {"name": "exact"},
        "requirement": [{"name": "gap", "unit": "mm", "method": "monte_carlo", "lower": -14.0203, "upper": -13.9797},
                        {"name": "other", "unit": "mm"}],
        "limits": {"gap": {"yield_percent": 99.73}, "other": {"variation": 0.05}},
        "part": [{**screw, "sensitivity": {"gap": -0.7}}, pin],
    }  # fmt: skip
    result = tolevo.run(table, out=tmp_path / "a")
    row = pd.read_csv(tmp_path / "a" / "nearest_miss.csv").iloc[0]
    assert result.summary["status"] == "no_feasible_point"
    assert row["screw_process"] == "best" and not row["feasible"]
    assert row["gap.yield_percent"] == pytest.approx(99.0953, abs=0.002)


def test_no_feasible_point_says_the_nearest_miss(tmp_path: Path) -> None:
    hard = limited(0.01, backlash_arcmin=Bound(high=0.4))
    found = run(plan(hard, NSGA2(population=10), generations=2), tmp_path / "a")
    assert found.status == "no_feasible_point"
    assert len(pd.read_csv(tmp_path / "a" / "nearest_miss.csv")) == 1
    assert any("nearest miss" in line for line in found.lines)


def test_interrupt_writes_what_was_found(tmp_path: Path) -> None:
    def stop(state: object) -> None:
        if getattr(state, "generation", 0) == 10:
            raise KeyboardInterrupt

    found = run(plan(limited(), references=True), tmp_path / "a", progress=stop)
    assert found.status == "interrupted"
    assert json.loads((tmp_path / "a" / "summary.json").read_text())["evaluations"] == 400
    assert len(pd.read_csv(tmp_path / "a" / "references.csv")) == 2


def test_gains_at_equal_performance_and_at_equal_cost() -> None:
    front = np.array([[1.0, 4.0], [2.0, 2.0], [4.0, 1.0]])
    none = np.zeros(2)
    assert gains(np.array([4.0, 2.0]), front, none) == pytest.approx([50.0, 50.0])
    assert np.isnan(gains(np.array([0.5, 0.5]), front, none)).all()
    reached = np.array([4.0, 2.0 - 1e-9])  # the last digits of an optimiser are no difference
    assert gains(reached, front, none)[0] == pytest.approx(0.0)
    assert gains(reached, front, np.full(2, 1e-6))[0] == pytest.approx(50.0)


def test_knee_is_farthest_from_the_chord() -> None:
    values = np.array([[0.0, 1.0], [0.1, 0.2], [0.5, 0.15], [1.0, 0.0]])
    np.testing.assert_array_equal(knee(values), [False, True, False, False])
    assert not knee(values[:2]).any()


def test_better_references_of_the_search_space_join_the_front() -> None:
    problem = RvBacklash(limited())
    printed = problem.references()["document B"]
    worse, outside = printed.copy(), printed.copy()
    worse[0], outside[0] = 2.9, 50.0
    front = problem.frame(worse[None, :]).drop(columns="feasible")
    worse_all = front.assign(cost=30.0, backlash_arcmin=3.0, bound=np.nan, gap_percent=np.nan)
    worse_all["knee"] = False
    references = problem.frame(np.stack([printed, outside]))
    found, dropped, joined = join_references(worse_all, references, problem)
    assert (dropped, joined) == (1, 1)
    assert found["pin_circle_radius_um"].tolist() == [3.0]
    assert found["involute_grade"].dtype == np.int64
    assert list(found.columns) == list(worse_all.columns)


def test_reference_stands_in_where_the_search_found_nothing() -> None:
    problem = RvBacklash(limited())
    references = problem.frame(np.stack(list(problem.references().values())))
    found, dropped, joined = join_references(pd.DataFrame(), references, problem)
    assert (len(found), dropped, joined) == (1, 0, 1)


def test_single_objective_run_never_ends_worse_than_its_reference(tmp_path: Path) -> None:
    one = Settings(variables=NEAR, limits=limited(backlash_arcmin=Bound(high=1.0)).limits, objectives=("cost",))
    found = run(plan(one, GA(population=30), references=True), tmp_path / "a")
    assert found.status == "done"
    best = found.result.references.query("feasible")["cost"].min()
    assert found.result.front["cost"].tolist() == pytest.approx([best])


def test_every_file_that_a_run_may_write_is_known_by_name() -> None:
    """What is not would be in no manifest, and would outlive the result that it belongs to."""
    frame = pd.DataFrame({"label": ["a"]})
    optional = [one.name for one in fields(RunResult) if one.type == "pd.DataFrame | None"]
    whole = replace(
        RunResult("t", frame, frame, frame, {}, (), overlays={"a": frame}),
        **dict.fromkeys(optional, frame),  # type: ignore[arg-type]
    )
    written = set(table_files(whole))
    assert {"overlays.csv", "unit_turn.csv", "front.csv", "exact_front.csv"} <= written
    assert written <= set(KINDS["run"].files)
    assert {*KINDS["run"].files, *KINDS["run"].pages, MANIFEST} >= FILES
