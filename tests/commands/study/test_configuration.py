"""Faults of a study's configuration: all at once, each with a place and a remedy."""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.small_jobs import POSE_BY_GA
from tolevo.cli import app
from tolevo.commands.study.configuration import read_study
from tolevo.commands.study.study import study
from tolevo.errors import InputError
from tolevo.execution import InProcess

pytestmark = pytest.mark.usefixtures("unrendered")

CONFIGS = Path(str(files("tolevo.configs")))
RUN = POSE_BY_GA.format(mrad=0.2, more="", population=20, generations=5)


def study_file(folder: Path, vary: str, rest: str = "", kind: str = "factorial") -> Path:
    (folder / "run.toml").write_text(RUN, encoding="utf-8")
    path = folder / "study.toml"
    text = f'run = "run.toml"\n{rest}\n[design]\nkind = "{kind}"\n[vary]\n{vary}\n'
    path.write_text(text, encoding="utf-8")
    return path


def faults_of(path: Path, *overrides: str) -> dict[str, str]:
    with pytest.raises(InputError) as caught:
        read_study(path, overrides)
    return {fault.place: fault.message for fault in caught.value.faults}


LEVELS = '"algorithm.population" = [10, 20]'


@pytest.mark.parametrize(
    ("vary", "place", "message"),
    [
        ('"algorithm.populaton" = [10, 20]', "vary.algorithm.populaton",
         r"did you mean `algorithm.population`"),
        ('"algorithm.mutation.probability" = [0.1, 1.3]', "vary.algorithm.mutation.probability",
         r"must lie in \[0, 1\], got 1.3"),
        ('"algorithm.population" = [10.5, 20]', "vary.algorithm.population[0]",
         "must be a whole number, got 10.5"),
        ('"algorithm.population" = { low = 80, high = 20, levels = 3 }',
         "vary.algorithm.population", "low must be below high"),
        ('"algorithm.mutation.eta" = { low = 0.0, high = 2.0, log = true, levels = 3 }',
         "vary.algorithm.mutation.eta", "logarithmic range must begin above 0"),
        ('"algorithm.population" = { low = 20, high = 80 }', "vary.algorithm.population",
         "factorial needs two or more"),
        ('"algorithm.population" = { low = 20, levels = 3 }', "vary.algorithm.population",
         "needs low and high"),
        ('"algorithm.population" = { low = 20, hihg = 30 }', "vary.algorithm.population.hihg",
         "did you mean `high`"),
        ('"algorithm.population" = [20, 20]', "vary.algorithm.population", "names 20 twice"),
        ('"algorithm.population" = { values = [20] }', "vary.algorithm.population",
         "must be a list of values or a table with low and high, not a table with values$"),
        ('"limits.backlash" = { values = [20] }', "vary.limits.backlash.values", "is not a setting of this run"),
        ('"algorithm.population" = ["a", "b"]', "vary.algorithm.population[0]",
         "must be a whole number"),
        ('"algorithm.name" = ["ga", "nsga3"]', "vary.algorithm.name",
         "needs two or more objectives"),
        ('"algorithm.crossover.operator" = ["sbx", "unifrom"]', "vary.algorithm.crossover.operator",
         "did you mean `uniform`"),
        ('"algorithm.engine" = ["pymoo", "array"]', "vary.algorithm.engine",
         "ga has no array engine"),
        ("seed = [1, 2]", "vary.seed", "replicates differ by their seeds"),
        ("", "vary", "is empty: name at least one key"),
    ],
)  # fmt: skip
def test_settings_that_make_no_sense(tmp_path: Path, vary: str, place: str, message: str) -> None:
    found = faults_of(study_file(tmp_path, vary))
    assert re.search(message, found[place])
    assert not any(re.search(r"did you mean `[^`]*values`", text) for text in found.values())  # one cause, one fault


def test_a_fault_of_a_combination_names_the_point(tmp_path: Path) -> None:
    """A variable whose lower bound is raised above its upper one at one point only."""
    vary = """
    "variables.rod_length_1_um.low" = [1.0, 30.0]
    "variables.rod_length_1_um.high" = [20.0, 40.0]
    """
    path = study_file(tmp_path, vary)
    ranged = RUN + "[variables.rod_length_1_um]\nlow = 1.0\nhigh = 40.0\n"
    (tmp_path / "run.toml").write_text(ranged, encoding="utf-8")
    found = faults_of(path)
    assert "(20), got 30" in found["vary.variables.rod_length_1_um.low"]


@pytest.mark.parametrize(
    ("rest", "message"),
    [
        ('response = ["hypervolume_ratio"]', "no meaning for one objective: use gap_percent"),
        ('response = ["gap_precent"]', "did you mean `gap_percent`"),
    ],
)
def test_unsuitable_responses(tmp_path: Path, rest: str, message: str) -> None:
    assert message in faults_of(study_file(tmp_path, LEVELS, rest))["response"]


def test_response_without_an_exact_front(tmp_path: Path) -> None:
    path = study_file(tmp_path, LEVELS, 'response = ["hypervolume_ratio"]')
    backlash = (CONFIGS / "rv40e_document.toml").read_text(encoding="utf-8")
    (tmp_path / "run.toml").write_text(backlash, encoding="utf-8")
    found = faults_of(path)
    assert "needs the exact front" in found["response"]
    assert read_study(path, ["response=hypervolume"]).settings.responses == ("hypervolume",)


def test_designs_too_small_say_what_they_need(tmp_path: Path) -> None:
    vary = '"algorithm.mutation.probability" = { low = 0.0, high = 0.1 }'
    path = study_file(tmp_path, vary, kind="sobol")
    found = faults_of(path, "design.samples=8", "seeds=1")
    assert "at least 128" in found["design.samples"]
    assert "at least 2 replicates" in found["seeds"]


def test_all_faults_at_once_status_2_nothing_written(tmp_path: Path) -> None:
    path = study_file(tmp_path, '"algorithm.populaton" = [1]', "seeds = 0\nfoo = 1", "factoral")
    out = tmp_path / "out"
    result = CliRunner().invoke(app, ["study", str(path), "--out", str(out), "--set",
                                      "run.algorithm.generations=0", "--workers", "0"])  # fmt: skip
    assert result.exit_code == 2
    lines = result.stderr.splitlines()
    for start in (
        "seeds: must be at least 1",
        "foo: is not a known key",
        "design.kind: must be",
        "run.algorithm.generations: must be at least 1",
        "--workers: must be",
    ):
        assert sum(line.startswith(start) for line in lines) == 1, (start, lines)
    assert not out.exists()


def test_a_study_without_its_run(tmp_path: Path) -> None:
    path = study_file(tmp_path, LEVELS)
    (tmp_path / "run.toml").unlink()
    assert faults_of(path) == {str(tmp_path / "run.toml"): "does not exist"}


def test_run_inline_and_overridden(tmp_path: Path) -> None:
    """The [run] table inline, overridden by a quoted key of the file and by --set."""
    path = tmp_path / "study.toml"
    inline = RUN.replace("[", "[run.").replace('problem = "pose', '[run]\nproblem = "pose')
    inline = inline.replace('minimise = [run."cost"]', 'minimise = ["cost"]')
    path.write_text(f'"run.algorithm.generations" = 7\n[design]\nkind = "factorial"\n[vary]\n'
                    f"{LEVELS}\n{inline}", encoding="utf-8")  # fmt: skip
    plan = read_study(path)
    assert {point.budget.generations for point in plan.points} == {7}
    plan = read_study(path, ["run.algorithm.generations=9"])
    assert {point.budget.generations for point in plan.points} == {9}
    assert plan.settings.base == {"algorithm.population": 20}


def test_keys_may_be_quoted_or_tables(tmp_path: Path) -> None:
    quoted = read_study(study_file(tmp_path, LEVELS))
    nested = read_study(study_file(tmp_path, "[vary.algorithm]\npopulation = [10, 20]"))
    # from Python 3.13 on dataclasses with NaN are not equal
    assert repr(nested.settings.factors) == repr(quoted.settings.factors)


def test_operators_are_categories(tmp_path: Path) -> None:
    vary = """
    "algorithm.crossover.operator" = ["sbx", "uniform", "two_point"]
    "algorithm.mutation.operator" = ["polynomial", "gaussian"]
    """
    path = study_file(tmp_path, vary, 'response = "feasible_fraction"\nseeds = 4')
    plan = read_study(path, ["run.limits.squareness_mrad=0.6"])
    assert all(factor.categorical for factor in plan.settings.factors)
    outcome = study(plan, tmp_path / "out", InProcess())
    assert outcome.result is not None
    fractions = outcome.result.table["feasible_fraction"].to_numpy().reshape(6, -1)
    assert len(np.unique(fractions, axis=0)) == 6


def test_algorithms_are_categories(tmp_path: Path) -> None:
    clutch = CONFIGS / "stack_clutch.toml"
    path = study_file(tmp_path, '"algorithm.name" = ["nsga2", "sms_emoa"]')
    (tmp_path / "run.toml").write_text(clutch.read_text(encoding="utf-8"), encoding="utf-8")
    plan = read_study(path, ["run.algorithm.population=20"])
    assert [type(point.algorithm).__name__ for point in plan.points] == ["NSGA2", "SMSEMOA"]
    assert len(plan.problems) == 1


@pytest.mark.parametrize("key", ["limits.squareness_mrad.max", "limits.squareness_mrad"])
def test_a_varied_problem_is_built_once_per_value(tmp_path: Path, key: str) -> None:
    vary = f'"{key}" = [0.2, 0.3]\n"algorithm.population" = [10, 20]'
    plan = read_study(study_file(tmp_path, vary))
    assert [point.problem for point in plan.points] == [0, 0, 1, 1]
    assert [p.limits[0].high for p in plan.problems] == [0.2, 0.3]


def test_check_describes_a_study(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["check", str(study_file(tmp_path, LEVELS))])
    assert result.exit_code == 0
    assert "# 20 runs: 2 settings, 10 replicates each" in result.stdout


def test_the_array_engine_has_its_own_operators(tmp_path: Path) -> None:
    path = study_file(tmp_path, '"algorithm.crossover.operator" = ["sbx", "uniform"]')
    clutch = (CONFIGS / "stack_clutch.toml").read_text(encoding="utf-8")
    (tmp_path / "run.toml").write_text(clutch, encoding="utf-8")
    found = faults_of(path, "run.algorithm.name=nsga2", "run.algorithm.engine=array")
    assert "the array engine has sbx only" in found["vary.algorithm.crossover.operator"]
