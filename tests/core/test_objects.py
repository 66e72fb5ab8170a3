"""Problems and algorithms as objects: of this suite, and plain ones of pymoo."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pymoo.core.problem import ElementwiseProblem, Problem

import tolevo
from tolevo.declarations import Kind, Output, Variable
from tolevo.errors import InputError
from tolevo.problems.designs import designs_of
from tolevo.problems.pose_accuracy import PoseAccuracy
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import Bound, PropagationSetting, Settings

SMALL = tolevo.algorithms.NSGA2(population=20)
FEW = ["algorithm.generations=10"]


class Circle(ElementwiseProblem):
    """Squared distances from two points, outside of a circle, on a line."""

    def __init__(self) -> None:
        super().__init__(n_var=2, n_obj=2, n_ieq_constr=1, n_eq_constr=1, xl=-2.0, xu=[2.0, 3.0])

    def _evaluate(self, x: Any, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        out["F"] = [(x[0] - 1.0) ** 2 + x[1] ** 2, (x[0] + 1.0) ** 2 + x[1] ** 2]
        out["G"] = [0.25 - x[0] ** 2 - x[1] ** 2]
        out["H"] = [x[1] - 1.0]


class Beam(Problem):
    """Mass and deflection of a cantilever; names and units are its own."""

    variables = (
        Variable("height_mm", "mm", Kind.NOMINAL, 10.0, 50.0, "height of the section"),
        Variable("ribs", "", Kind.NOMINAL, 0.0, 4.0, "number of ribs", integer=True),
    )
    outputs = (Output("mass_kg", "kg", "mass"), Output("sag_mm", "mm", "deflection at the end"))

    def __init__(self) -> None:
        super().__init__(n_var=2, n_obj=2, xl=[10.0, 0.0], xu=[50.0, 4.0])

    def _evaluate(self, x: Any, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        out["F"] = np.stack([x[:, 0] / 10.0 + x[:, 1], 1e5 / x[:, 0] ** 3 / (1.0 + x[:, 1])], 1)


class Unbounded(Problem):
    def __init__(self) -> None:
        super().__init__(n_var=2, n_obj=1, xl=0.0, xu=np.inf)


class NeedsArguments(Problem):
    def __init__(self, size: int) -> None:
        super().__init__(n_var=size, n_obj=1, xl=0.0, xu=1.0)


def faults_of(source: Any) -> list[str]:
    with pytest.raises(InputError) as caught:
        tolevo.read(source)
    return [str(fault) for fault in caught.value.faults]


def test_a_plain_pymoo_problem_runs_and_keeps_its_constraints(tmp_path: Path) -> None:
    result = tolevo.run(Circle(), tmp_path / "out", algorithm=SMALL, seed=1,
                        settings=["algorithm.generations=40", "algorithm.engine=array",
                                  "parameters.equality_tolerance=0.05"])  # fmt: skip
    front = result.front
    assert len(front) > 5
    assert np.all(np.abs(front["x2"] - 1.0) <= 0.05)
    np.testing.assert_allclose(front["f1"], (front["x1"] - 1.0) ** 2 + front["x2"] ** 2)
    np.testing.assert_allclose(front["g1"], 0.25 - front["x1"] ** 2 - front["x2"] ** 2)
    assert (tmp_path / "out" / "report.html").is_file()
    assert "test_objects:Circle" in (tmp_path / "out" / "config.toml").read_text(encoding="utf-8")
    named = [one["name"] for one in result.summary["assumptions"]]
    assert "parameters.equality_tolerance" in named


def test_declared_names_units_and_whole_numbers_are_kept() -> None:
    front = tolevo.run(Beam(), algorithm=SMALL, settings=FEW).front
    assert {"height_mm", "ribs", "mass_kg", "sag_mm"} <= set(front)
    assert front["ribs"].dtype == np.int64
    limited = tolevo.run({"problem": Beam(), "limits": {"sag_mm": "0.3 mm"}}, algorithm=SMALL,
                         settings=FEW)  # fmt: skip
    assert limited.front["sag_mm"].max() <= 0.3


def test_a_class_is_named_by_its_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "own_plain.py").write_text(
        "from pymoo.problems.multi import ZDT1\nclass Own(ZDT1):\n"
        "    def __init__(self):\n        super().__init__(n_var=4)\n",
        encoding="utf-8",
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    table = {"problem": "own_plain:Own", "algorithm": {"population": 20, "generations": 5}}
    by_name = tolevo.run(table)
    again = tolevo.run(tolevo.read(table))
    pd.testing.assert_frame_equal(by_name.front, again.front)
    own = sys.modules["own_plain"].Own
    pd.testing.assert_frame_equal(by_name.front, tolevo.run(table | {"problem": own()}).front)


@pytest.mark.parametrize(
    "problem",
    [
        RvBacklash(
            Settings(
                propagation=PropagationSetting(method="moments"), limits={"interference_probability": Bound(high=0.3)}
            )
        ),
        PoseAccuracy(),
        tolevo.read({"problem": "pose_accuracy", "name": "arm", "seed": 3}).problem,
    ],
    ids=["rv_backlash", "pose_accuracy", "read"],
)
def test_a_problem_of_the_suite_is_its_configuration(problem: Any) -> None:
    found = tolevo.read(problem)
    assert found.problem is not None
    middle = problem.complete(0.5 * (problem.xl + problem.xu)[None, :])
    pd.testing.assert_frame_equal(found.problem.frame(middle), problem.frame(middle))
    assert found.problem.objectives == problem.objectives
    assert tolevo.read(found.tables()).toml() == found.toml()


def test_what_is_given_beside_a_problem_counts() -> None:
    found = tolevo.read({"problem": PoseAccuracy(), "limits": {"yaw_mrad": 0.4}})
    assert found.problem is not None
    assert found.problem.settings.limits["yaw_mrad"] == Bound(high=0.4)
    fixed = {"problem": RvBacklash(), "variables": {"pin_position_um": {"value": 3.0}}}
    problem = tolevo.read(fixed).problem  # a value takes the place of a range, as in a file
    assert problem is not None
    assert problem.fixed["pin_position_um"] == 3.0


class OwnsSomething(PoseAccuracy):
    """A problem of the suite with an attribute that a plain one has as well."""

    own = "workshop"


def test_an_attribute_makes_no_plain_problem() -> None:
    found = tolevo.read(OwnsSomething())
    assert found.problem_name.endswith(":OwnsSomething")
    assert isinstance(found.problem, PoseAccuracy)


def test_algorithm_and_seed_take_the_place_of_those_in_the_source() -> None:
    table = {"problem": "pose_accuracy", "seed": 1,
             "algorithm": {"name": "gde3", "generations": 7, "engine": "array"}}  # fmt: skip
    found = tolevo.read(table, algorithm=SMALL, seed=5)
    assert (found.algorithm_name, found.algorithm, found.seed) == ("nsga2", SMALL, 5)
    assert (found.budget.generations, found.engine) == (7, "array")
    again = tolevo.read(found, algorithm=tolevo.algorithms.GDE3(population=30))
    assert (again.algorithm_name, again.seed) == ("gde3", 5)


@pytest.mark.parametrize(
    ("problem", "text"),
    [
        (3, "problem: int is no problem: it must be a ToleranceProblem or a pymoo Problem"),
        ("pathlib:Path", 'problem: "pathlib:Path" is not a class of problems: it must be a subclass of Problem'),
        ("no.such:Thing", 'problem: "no.such:Thing" cannot be imported (ModuleNotFoundError'),
        (Unbounded(), "problem: Unbounded needs finite bounds xl < xu of every variable"),
        (NeedsArguments, "problem: NeedsArguments cannot be made without arguments"),
    ],
    ids=str,
)
def test_an_object_that_is_no_problem_is_a_fault(problem: Any, text: str) -> None:
    assert any(fault.startswith(text) for fault in faults_of({"problem": problem}))


# ---------------------------------------------------------------- asking and telling


def told(search: Any, problem: Any, generations: int) -> Any:
    for _ in range(generations):
        x = search.ask()
        search.tell(x, problem.outputs_of(designs_of(problem, x), searching=True))
    return search.result()


@pytest.mark.parametrize("engine", ["pymoo", "array"])
def test_a_loop_of_ones_own_finds_what_run_finds(engine: str) -> None:
    table = {"problem": Beam(), "references": "none",
             "algorithm": {"generations": 8, "engine": engine}}  # fmt: skip
    problem = tolevo.read(table).problem
    assert problem is not None
    search = tolevo.search(table, SMALL, seed=4)
    result = told(search, problem, 8)
    front = tolevo.run(table, algorithm=SMALL, seed=4).front
    assert result.evaluations == 8 * 20
    pd.testing.assert_frame_equal(result.front[problem.names].reset_index(drop=True), front[problem.names])


def test_a_search_begins_with_given_designs() -> None:
    problem = RvBacklash()
    first = told(tolevo.search(problem, SMALL, seed=1), problem, 3).front
    for engine in ("pymoo", "array"):
        search = tolevo.search(problem, SMALL, start=first, settings=[f"algorithm.engine={engine}"])
        pd.testing.assert_frame_equal(search.ask().head(len(first)), first[problem.names].head(20))
        later = told(search, problem, 1).front
        assert later["cost"].min() <= first["cost"].min()


def test_bad_answers_are_all_named() -> None:
    search = tolevo.search(PoseAccuracy(), SMALL)
    x = search.ask()
    with pytest.raises(InputError) as caught:
        search.tell(x, {"cost": np.ones(3)})
    places = [fault.place for fault in caught.value.faults]
    assert places[0] == "outputs.cost"
    assert len(places) > 1
    with pytest.raises(InputError, match="must be the designs that ask"):
        search.tell(x.iloc[::-1].reset_index(drop=True), {})
    pd.testing.assert_frame_equal(search.ask(), x)  # nothing is lost by a bad answer
    with pytest.raises(InputError, match="evaluates designs itself"):
        tolevo.search(PoseAccuracy(), tolevo.algorithms.Exact())
