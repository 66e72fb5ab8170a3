"""What a run of a study returns, against `search` and closed forms."""

from __future__ import annotations

import pickle
import tomllib
from importlib.resources import files
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.small_jobs import POSE_BY_GA
from tolevo.algorithms.archive import DEFAULT_PER_OCTAVE, Box, Course, is_charted_generation
from tolevo.algorithms.search import search
from tolevo.commands.run.proofs import exact_front
from tolevo.commands.study.configuration import read_study
from tolevo.commands.study.plan import StudyOutcome, StudyPlan
from tolevo.commands.study.study import study
from tolevo.configuration.reader import read
from tolevo.errors import RunError
from tolevo.execution import InProcess
from tolevo.problems.pose_accuracy import PoseAccuracy
from tolevo.problems.tolerance_problem import ToleranceProblem

pytestmark = pytest.mark.usefixtures("unrendered")

ONE = (
    POSE_BY_GA.format(mrad=0.2, more="yaw_mrad = 0.2", population=20, generations=30)
    + "[algorithm.mutation]\nprobability = 0.08\n"
)
STUDY = """
run = "run.toml"
seeds = 3
response = ["gap_percent", "evaluations_to_99", "feasible_fraction"]
[design]
kind = "factorial"
[vary]
"algorithm.population" = [10, 20]
"algorithm.crossover.probability" = [0.3, 0.99]
"""


def written(folder: Path, text: str = STUDY, run: str = ONE) -> Path:
    (folder / "run.toml").write_text(run, encoding="utf-8")
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


def done(plan: StudyPlan, out: Path) -> StudyOutcome:
    return study(plan, out, InProcess())


def table_of(out: Path) -> pd.DataFrame:
    return pd.read_csv(out / "study.csv", keep_default_na=False, na_values=[""])


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, StudyOutcome]:
    """The folder of a configuration, and its study, in `out` there."""
    folder = tmp_path_factory.mktemp("study")
    return folder, done(read_study(written(folder)), folder / "out")


def test_table_of_a_study(whole: tuple[Path, StudyOutcome]) -> None:
    folder, outcome = whole
    assert outcome.status == "done"
    found = table_of(folder / "out")
    assert list(found) == [
        "point", "algorithm.population", "algorithm.crossover.probability", "replicate", "seed",
        "status", "reason", "gap_percent", "evaluations_to_99", "feasible_fraction",
    ]  # fmt: skip
    assert found["point"].tolist() == [at for at in range(4) for _ in range(3)]
    assert found["replicate"].tolist() == [0, 1, 2] * 4
    assert (found["status"] == "done").all()
    seeds = found.pivot_table(index="point", columns="replicate", values="seed").to_numpy()
    assert (seeds == seeds[0]).all()
    assert len(set(seeds[0])) == 3


def test_a_run_is_that_of_search(whole: tuple[Path, StudyOutcome]) -> None:
    """Same designs as `search` with the same settings and seed, gap to the closed form."""
    folder, outcome = whole
    data = outcome.result
    assert data is not None
    row = data.table.iloc[-1]
    changes = ["algorithm.population=20", "algorithm.crossover.probability=0.99"]
    run = read(folder / "run.toml", changes)
    assert run.problem is not None
    assert run.algorithm is not None
    found = search(run.problem, run.algorithm, run.budget, int(row["seed"]))
    exact = exact_front(run.problem)
    assert exact is not None
    optimum = run.problem.outputs_of(exact.designs[:1])["cost"][0]
    gap = 100.0 * (found.f.min() / optimum - 1.0)
    # the bound is that of limits wider by twice the room of rounding, 2e-9
    assert row["gap_percent"] == pytest.approx(gap, abs=1e-6)
    curves = data.curves.of(3)
    curve = curves[curves["replicate"] == 2]
    assert curve["value"].iloc[-1] == found.f.min()
    assert curve["evaluations"].iloc[-1] == found.evaluations == 600
    np.testing.assert_array_equal(curve["feasible_fraction"], [state.feasible_fraction for state in found.history])
    assert data.exact["value"].to_numpy() == pytest.approx(np.full(4, optimum), rel=1e-9)
    shares = [state.feasible_fraction for state in found.history]
    assert row["feasible_fraction"] == pytest.approx(np.mean(shares))


def test_a_front_is_measured_as_search_does(tmp_path: Path) -> None:
    """Hypervolumes of a curve against the archive of `search`, and the evaluations to 99 %."""
    path = Path(str(files("tolevo.configs") / "stack_clutch.toml"))
    text = f"""
    run = "{path}"
    seeds = 2
    response = ["hypervolume_ratio", "hypervolume", "gap_percent", "evaluations_to_99"]
    [design]
    kind = "factorial"
    [vary]
    "algorithm.engine" = ["array", "pymoo"]
    """
    changes = ["name=nsga2", "population=40", "generations=20"]
    plan = read_study(written(tmp_path, text), [f"run.algorithm.{one}" for one in changes])
    data = done(plan, tmp_path / "out").result
    assert data is not None
    problem = plan.problems[0]
    exact = exact_front(problem)
    assert exact is not None
    for row in data.table.to_dict("records"):
        at = plan.points[row["point"]]
        engine = row["algorithm.engine"]
        found = search(problem, at.algorithm, at.budget, row["seed"], engine=engine)
        curves = data.curves.of(row["point"])
        own = curves[curves["replicate"] == row["replicate"]]
        course = np.array([state.hypervolume for state in found.history])
        np.testing.assert_allclose(own["value"], course[own["generation"] - 1], rtol=1e-12)
        assert row["hypervolume_ratio"] == pytest.approx(course[-1] / exact.hypervolume, rel=1e-12)
        assert row["hypervolume"] == pytest.approx(course[-1], rel=1e-12)
        there = np.flatnonzero(course >= 0.99 * exact.hypervolume)
        if len(there):
            assert 40 * there[0] < row["evaluations_to_99"] <= 40 * (there[0] + 1)
        else:
            assert np.isnan(row["evaluations_to_99"])
        assert 0.0 <= row["gap_percent"] < 100.0
    assert (data.table["evaluations_to_99"] > 0).any()


def staircase(steps: int) -> np.ndarray:
    """Points on x + y = 1, each widening the dominated area."""
    x = np.linspace(0.0, 1.0, steps)
    return np.stack([x, 1.0 - x], axis=1)


def test_the_evaluation_that_reaches_a_level_is_found_within_a_batch() -> None:
    """Against the hypervolume after every single evaluation, a third of them infeasible."""
    rng = np.random.default_rng(3)
    points = rng.permutation(staircase(60)) + 0.05 * rng.random((60, 1))
    feasible = rng.random(60) > 1.0 / 3.0
    box = Box((0.0, 0.0), (1.0, 1.0))
    areas = [box.hypervolume(points[: at + 1][feasible[: at + 1]]) for at in range(60)]
    for level in (0.2, 0.4, 0.55, 0.6):
        course = Course(box, level)
        for start in range(0, 60, 4):
            course.add(points[start : start + 4], feasible[start : start + 4], float(start))
        curve = course.curve()
        first = int(np.argmax(np.array(areas) >= level)) + 1
        evaluations, cpu_s = course.reached_at
        assert evaluations == first
        assert cpu_s == 4.0 * ((first - 1) // 4)
        np.testing.assert_allclose(curve[:, 3], [areas[int(n) - 1] for n in curve[:, 1]])


def test_charted_generations_do_not_depend_on_the_end() -> None:
    chosen = [g for g in range(1, 65) if is_charted_generation(g, DEFAULT_PER_OCTAVE)]
    assert chosen == [1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40, 48, 56, 64]


def test_a_long_course_is_bounded_and_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks of 50 values against one block of all."""
    rng = np.random.default_rng(5)
    points = np.sort(rng.random((400, 2)), axis=0)[::-1] + 0.1 * rng.random((400, 2))
    courses = []
    for block in (50, 10_000):
        monkeypatch.setattr("tolevo.algorithms.archive.BLOCK", block)
        course = Course(Box((0.0, 0.0), (1.0, 1.0)), 0.9)
        for start in range(0, 400, 10):
            course.add(points[start : start + 10], np.ones(10, dtype=bool), 0.0)
        courses.append((course.curve(), course.reached_at))
    np.testing.assert_array_equal(courses[0][0], courses[1][0])
    assert courses[0][1] == courses[1][1]
    assert courses[0][1][0] > 100


def faulty(monkeypatch: pytest.MonkeyPatch, what: str) -> None:
    """Let `pose_accuracy` fail for batches of ten: those of the smaller population."""
    sound = PoseAccuracy._outputs

    def outputs(self: PoseAccuracy, designs: np.ndarray, searching: bool) -> dict[str, np.ndarray]:
        found = sound(self, designs, searching)
        if len(designs) == 10 and what == "exception":
            raise ZeroDivisionError("a part has no size\nsecond line")
        if len(designs) == 10 and what == "nan":
            found = found | {"cost": np.full(len(designs), np.nan)}
        return found

    monkeypatch.setattr(PoseAccuracy, "_outputs", outputs)


@pytest.mark.parametrize(
    ("what", "reason"),
    [("exception", "ZeroDivisionError: a part has no size"), ("nan", "ModelError: F or G is not finite at")],
)
def test_a_failed_run_is_recorded_and_the_study_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str, reason: str
) -> None:
    faulty(monkeypatch, what)
    few = read_study(written(tmp_path), ["run.algorithm.generations=4"])
    outcome = done(few, tmp_path / "out")
    found = table_of(tmp_path / "out")
    small = found["algorithm.population"] == 10
    assert (found["status"] == np.where(small, "failed", "done")).all()
    assert found.loc[small, "reason"].str.startswith(reason).all()
    assert found.loc[~small, "reason"].isna().all()
    assert found.loc[small, "feasible_fraction"].isna().all()
    assert found.loc[~small, "feasible_fraction"].notna().all()
    assert "6 failed" in outcome.lines[0]


def test_a_run_over_its_time_limit_has_failed(tmp_path: Path) -> None:
    plan = read_study(written(tmp_path), ["time_limit_s=1e-9", "seeds=2"])
    with pytest.raises(RunError, match=r"every run failed.*OverTime: time limit of 1e-09 s"):
        done(plan, tmp_path / "out")
    found = table_of(tmp_path / "out")
    assert (found["status"] == "failed").all()


def test_problems_are_pickled_once_and_small(tmp_path: Path) -> None:
    """A task carries its problem: that must stay some kilobytes."""
    plan = read_study(written(tmp_path))
    assert len(plan.problems) == 1
    assert len(pickle.dumps(plan.problems[0])) < 20_000
    assert isinstance(pickle.loads(pickle.dumps(plan.problems[0])), ToleranceProblem)


def test_resolved_configuration_repeats_the_study(tmp_path: Path) -> None:
    plan = read_study(written(tmp_path))
    again = tmp_path / "again.toml"
    again.write_text(plan.settings.configuration, encoding="utf-8")
    repeated = read_study(again)
    assert repeated.settings.configuration == plan.settings.configuration
    pd.testing.assert_frame_equal(repeated.design, plan.design)
    assert tomllib.loads(plan.settings.configuration)["seeds"] == 3
