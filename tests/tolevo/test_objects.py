"""Problems and algorithms as objects: of this suite, and plain ones of pymoo."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pymoo.core.problem import ElementwiseProblem, Problem
from pymoo.core.variable import Binary, Choice, Integer, Real
from pymoo.core.variable import Variable as PymooVariable

import tolevo
from tolevo.errors import InputError
from tolevo.problems.pose_accuracy import PoseAccuracy
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import Bound, PropagationSetting, Settings
from tolevo.problems.tolerance_problem import designs_of
from tolevo.section import Kind, Output, Variable

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
        search.tell(x.assign(rod_length_1_um=1.0), {})
    pd.testing.assert_frame_equal(search.ask(), x)  # nothing is lost by a bad answer
    with pytest.raises(InputError, match="evaluates designs itself"):
        tolevo.search(PoseAccuracy(), tolevo.algorithms.Exact())


def seat(**more: Any) -> Any:
    """A stack of two parts: cost 2 + 0.1 / a_t + 0.1 / b_t."""
    part: dict[str, Any] = {"sensitivity": 1.0, "nominal": 5.0, "t_min": 0.01, "t_max": 0.2}
    part["cost"] = {"model": "reciprocal", "a": 1.0, "b": 0.1}
    return tolevo.read(
        {
            "problem": "stack",
            "requirement": {"name": "gap", "unit": "mm"},
            "objectives": {"minimise": ["cost", "variation"]},
            "part": [part | {"name": "a"}, part | {"name": "b", "sensitivity": -1.0}],
            **more,
        }
    )


def first_cost(front: pd.DataFrame) -> pd.Series:
    return 2.0 + 0.1 / front["a_t"] + 0.1 / front["b_t"]


NEEDED = ["cost", "variation"]


@pytest.mark.parametrize(
    "order",
    [
        lambda x, y: (x, y.sample(frac=1, random_state=1)),  # as the bench returned them
        lambda x, y: (x, y.sample(frac=1, random_state=1).reset_index(drop=True)),  # by its columns
        lambda x, y: (x, y.sample(frac=1, random_state=1)[NEEDED]),  # by its index
        lambda x, y: (x, y.sample(frac=1, random_state=1).round(9).reset_index(drop=True)),
        lambda x, y: (x.sample(frac=1, random_state=2), y[NEEDED].sample(frac=1, random_state=2)),
        lambda x, y: (x.sample(frac=1, random_state=2), y.sample(frac=1, random_state=3)),
        lambda x, y: (x.iloc[::-1].reset_index(drop=True), {n: y[n].to_numpy()[::-1] for n in NEEDED}),
        lambda x, y: (x, {n: y[n].sample(frac=1, random_state=4) for n in NEEDED}),
    ],
    ids=["index", "columns", "index alone", "rounded", "the same for both", "both", "arrays", "series"],
)
def test_outputs_in_another_order_belong_to_their_designs(order: Any) -> None:
    stack = seat()
    search = tolevo.search(stack, SMALL, seed=1)
    x = search.ask()
    search.tell(*order(x, tolevo.evaluate(stack, x)))
    front = search.result().front
    np.testing.assert_allclose(front["cost"], first_cost(front), rtol=1e-6)  # of designs rounded to 1e-9


@pytest.mark.parametrize(
    ("order", "text"),
    [
        (lambda x, y: (x, y[NEEDED].set_axis(np.arange(100, 120))), "an order that is not known"),
        (
            lambda x, y: (x.iloc[::-1], y[NEEDED].sample(frac=1, random_state=3)),
            "an order that is not known: .*the columns a_t, b_t",
        ),
        (lambda x, y: (x, y.assign(a_t=0.1)), "belong to other designs"),
        (
            lambda x, y: (x, y.sample(frac=1, random_state=3)[["a_t", *NEEDED]].reset_index(drop=True)),
            "belong to other designs",
        ),
        (lambda x, y: (x, y.head(5)), "outputs.cost: must have shape"),
        (
            lambda x, y: (x, y[NEEDED].astype(object).mask(np.eye(*y[NEEDED].shape) > 0, "broke")),
            'outputs.cost: must have numbers, and NaN where an evaluation failed, got "broke"',
        ),
    ],
    ids=["another index", "a third order", "other designs", "some columns", "too few", "text"],
)
def test_outputs_whose_order_is_not_known_are_refused(order: Any, text: str) -> None:
    stack = seat()
    search = tolevo.search(stack, SMALL, seed=1)
    x = search.ask()
    with pytest.raises(InputError, match=text):
        search.tell(*order(x, tolevo.evaluate(stack, x)))


def test_a_start_outside_of_the_ranges_is_refused() -> None:
    start = pd.DataFrame({"a_t": [0.1, 0.5], "b_t": [0.001, 0.1]})
    with pytest.raises(InputError) as caught:
        tolevo.search(seat(), SMALL, start=start)
    assert [str(fault) for fault in caught.value.faults] == [
        "start: row 2, column a_t: must be at most 0.2 mm, got 0.5",
        "start: row 1, column b_t: must be at least 0.01 mm, got 0.001",
    ]
    fixed = tolevo.read({"problem": Beam(), "variables": {"ribs": {"value": 2}}})
    with pytest.raises(InputError, match=r"row 1, column ribs: is fixed at 2, got 1"):
        tolevo.search(fixed, SMALL, start=pd.DataFrame({"height_mm": [20.0], "ribs": [1]}))


def test_a_failed_evaluation_that_is_told_is_infeasible_and_listed() -> None:
    for engine in ("pymoo", "array"):
        stack = seat(algorithm={"engine": engine})
        search = tolevo.search(stack, SMALL, seed=1)
        failed = 0
        for _ in range(6):
            x = search.ask()
            y = tolevo.evaluate(stack, x)
            y.loc[y["a_t"] > 0.12, "variation"] = np.nan
            failed += int((x["a_t"] > 0.12).sum())
            search.tell(x, y)
        result = search.result()
        assert failed > 0
        assert len(result.failed) == failed
        assert (result.failed["a_t"] > 0.12).all()
        assert len(result.front)
        assert (result.front["a_t"] <= 0.12).all()


# ---------------------------------------------------------------- problems as pymoo states them


class Mixed(ElementwiseProblem):
    """Of pymoo's documentation on mixed variables, with two objectives."""

    def __init__(self) -> None:
        kinds = {
            "b": Binary(),
            "m": Choice(options=["al", "ss"]),
            "n": Integer(bounds=(0, 2)),
            "y": Real(bounds=(0, 5)),
        }
        super().__init__(vars=kinds, n_obj=2)

    def _evaluate(self, x: Any, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        assert isinstance(x["b"], bool)
        assert isinstance(x["n"], int)
        second = (x["n"] + 2) ** 2 + (x["y"] - 1) ** 2 + 10 * (x["m"] == "ss") + x["b"]
        out["F"] = [x["n"] ** 2 + x["y"] ** 2, second]


class Fails(Problem):
    """A simulation that does not converge where x1 is below 0.3."""

    def __init__(self, constraints: int = 0) -> None:
        super().__init__(n_var=2, n_obj=2, n_ieq_constr=constraints, xl=0, xu=1)

    def _evaluate(self, x: Any, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        first = np.where(x[:, 0] < 0.3, np.nan, x[:, 0])
        out["F"] = np.column_stack([first, 1 - x[:, 0] + x[:, 1]])
        if self.n_ieq_constr:
            out["G"] = np.where(x[:, :1] < 0.3, np.nan, x[:, :1] - 0.9)


class Whole(Problem):
    """36 designs, 6 of them on the front."""

    def __init__(self) -> None:
        self.computed: list[tuple[float, ...]] = []
        super().__init__(n_var=2, n_obj=2, xl=0, xu=5, vtype=int)

    def _evaluate(self, x: Any, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        self.computed += map(tuple, np.asarray(x).tolist())
        out["F"] = np.column_stack([x[:, 0] ** 2 + x[:, 1], (x[:, 0] - 5) ** 2 + x[:, 1]])


def test_mixed_variables_keep_their_names_and_kinds(tmp_path: Path) -> None:
    result = tolevo.run(Mixed(), tmp_path / "o", algorithm=SMALL, seed=1, settings=["algorithm.generations=30"])
    front = result.front
    assert set(front["m"]) == {"al"}
    np.testing.assert_allclose(front["f1"], front["n"] ** 2 + front["y"] ** 2)
    np.testing.assert_allclose(front["f2"], (front["n"] + 2) ** 2 + (front["y"] - 1) ** 2 + front["b"])
    np.testing.assert_allclose(tolevo.evaluate(Mixed(), front)["f2"], front["f2"])
    assert "choice" in tolevo.check(Mixed())


@pytest.mark.parametrize(
    ("kinds", "text"),
    [
        ({"y": Real(bounds=(0, None))}, "Bad needs finite bounds of the variable y"),
        ({"m": Choice(options=["one"])}, "Bad has the choice m with the options"),
        ({"v": PymooVariable()}, "Bad has the variable v of the kind Variable"),
    ],
    ids=["no bound", "one option", "no kind"],
)
def test_mixed_variables_that_cannot_be_searched_are_refused(kinds: dict[str, Any], text: str) -> None:
    bad = type("Bad", (Mixed,), {"__init__": lambda self: ElementwiseProblem.__init__(self, vars=kinds, n_obj=2)})
    assert any(text in fault for fault in faults_of({"problem": bad()}))


@pytest.mark.parametrize("constraints", [0, 1])
@pytest.mark.parametrize("name", ["nsga2", "gde3", "hybrid", "exact", "random"])
def test_a_failed_evaluation_is_infeasible_counted_and_listed(tmp_path: Path, name: str, constraints: int) -> None:
    budget = {"evaluations": 200} if name in ("hybrid", "exact") else {"generations": 5, "population": 20}
    table = {"problem": Fails(constraints), "seed": 1, "algorithm": {"name": name, **budget}}
    result = tolevo.run(table, tmp_path / "o")
    assert result.status == "done"
    assert (result.front["x1"] >= 0.3).all()
    failed = pd.read_csv(tmp_path / "o" / "failed.csv")
    assert (failed["x1"] < 0.3).all()
    assert result.summary["failed_evaluations"] == len(failed)
    assert any(f"{len(failed)} of {result.summary['evaluations']} evaluations failed" in line for line in result.lines)


@pytest.mark.parametrize("engine", ["pymoo", "array"])
def test_no_discrete_design_is_evaluated_twice(engine: str) -> None:
    problem = Whole()
    table = {"problem": problem, "seed": 1,
             "algorithm": {"name": "nsga2", "population": 40, "generations": 15, "engine": engine}}  # fmt: skip
    result = tolevo.run(table)
    assert len(problem.computed) == len(set(problem.computed)) == 36
    assert sorted(result.front["x1"]) == [0, 1, 2, 3, 4, 5]
    assert result.summary["evaluations"] == 36


def test_no_discrete_design_is_asked_for_twice() -> None:
    problem, computed = Whole(), list[tuple[float, ...]]()
    search = tolevo.search(problem, SMALL, seed=1)
    for _ in range(12):
        x = search.ask()
        computed += map(tuple, x.to_numpy().tolist())
        search.tell(x, {"f1": x["x1"] ** 2 + x["x2"], "f2": (x["x1"] - 5) ** 2 + x["x2"]})
    assert len(search.ask()) == 0
    assert len(computed) == len(set(computed)) == 36
    assert len(search.result().front) == 6


@pytest.mark.parametrize(("failed", "count"), [([True, False, False, False], 1), (["yes", "", "no", np.nan], 1)])
def test_a_column_failed_counts_as_failed(failed: list[Any], count: int) -> None:
    stack = seat()
    search = tolevo.search(stack, tolevo.algorithms.NSGA2(population=4), seed=1)
    x = search.ask()
    search.tell(x, tolevo.evaluate(stack, x)[["cost", "variation"]].assign(failed=failed))
    assert len(search.result().failed) == count
    x = search.ask()
    outputs = tolevo.evaluate(stack, x)[["cost", "variation"]].assign(failed="perhaps")
    with pytest.raises(InputError, match=r"outputs\.failed: must be true or false"):
        search.tell(x, outputs)


class WithoutValues(Problem):
    """Every evaluation fails."""

    def __init__(self) -> None:
        super().__init__(n_var=2, n_obj=1, n_ieq_constr=1, xl=0.0, xu=1.0)

    def _evaluate(self, x: Any, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        out["F"], out["G"] = np.full((len(x), 1), np.nan), x[:, :1] - 0.5


@pytest.mark.parametrize("algorithm", [tolevo.algorithms.GA(population=8), tolevo.algorithms.Hybrid(population=8)])
def test_a_search_without_any_value_says_so(algorithm: Any) -> None:
    run = tolevo.run(WithoutValues(), algorithm=algorithm, seed=1, settings=["algorithm.generations=2"])
    assert run.status == "no_feasible_point"
    assert run.lines[-1] == "no evaluation has a value, so that nothing is known of the limits"


def test_a_certificate_of_designs_without_values_says_so() -> None:
    lines = tolevo.certify(WithoutValues(), np.array([[0.1, 0.2], [0.3, 0.4]])).lines
    assert lines[0] == "2 of 2 designs have no value: an objective is not finite there"
    assert not any("0 of 2" in line for line in lines)
