"""`tolevo.certify`: bounds, best known and scatter of results of any optimiser."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.problem import Problem
from pymoo.optimize import minimize

import tolevo
from tolevo.algorithms.exact.fitted import HELD_OUT, designs_to_fit, fitted, least_value
from tolevo.errors import InputError

LOW, HIGH = np.full(3, 0.1), np.full(3, 2.0)
A, B = np.array([1.0, 2.0, 3.0]), np.array([3.0, 1.0, 2.0])


class Costs(Problem):
    """cost = sum a/x against the root sum of squares of b x."""

    def __init__(self) -> None:
        super().__init__(n_var=3, n_obj=2, xl=LOW, xu=HIGH)

    def _evaluate(self, x: Any, out: Any, *args: Any, **kwargs: Any) -> None:
        out["F"] = np.column_stack([(A / x).sum(axis=1), np.sqrt(((B * x) ** 2).sum(axis=1))])


class Waves(Problem):
    """One objective with many minima: no form."""

    def __init__(self) -> None:
        super().__init__(n_var=2, n_obj=1, xl=-2.0, xu=2.0)

    def _evaluate(self, x: Any, out: Any, *args: Any, **kwargs: Any) -> None:
        out["F"] = (x**2 + np.cos(7.0 * x)).sum(axis=1)


def least_cost(variation: float) -> float:
    """The least cost at a variation by Lagrange, x = (a / (2 m b^2))^(1/3) within the box, m by bisection."""
    low, high = 1e-9, 1e9
    for _ in range(200):
        m = np.sqrt(low * high)
        x = np.clip(np.cbrt(A / (2.0 * m * B**2)), LOW, HIGH)
        low, high = (m, high) if np.sqrt(np.sum((B * x) ** 2)) > variation else (low, m)
    return float(np.sum(A / x))


FEW: dict[str, Any] = {"seeds": 1, "evaluations": 300}


def test_a_front_of_pymoo_has_the_bound_of_lagrange() -> None:
    result = minimize(Costs(), NSGA2(pop_size=20), ("n_gen", 10), seed=1)
    found = tolevo.certify(Costs(), result, **FEW)
    assert dict(found.forms) == {"f1": "separable or posynomial", "f2": "root of a convex quadratic"}
    for _, point in found.points.iterrows():
        exact = least_cost(point["f2"])
        assert point["bound"] <= exact * (1.0 + 1e-9)
        assert point["bound"] == pytest.approx(exact, rel=1e-5)
    assert (found.points["gap_percent"] >= 0.0).all()
    assert "verified there and not between them" in found.statement


def test_no_form_is_said_and_nothing_is_proven() -> None:
    found = tolevo.certify(Waves(), np.array([[0.4, 0.4], [1.0, 1.0]]), **FEW)
    assert found.forms["f1"] == "no form"
    assert found.points["bound"].isna().all()
    assert found.statement.startswith("nothing is proven")
    assert (found.points["distance_percent"] > 0.0).any() or (found.points["best_known"] < 0.0).all()


X = np.array([[0.5, 0.5, 0.5], [1.0, 0.4, 0.7]])
VALUES = np.column_stack([(A / X).sum(axis=1), np.sqrt(((B * X) ** 2).sum(axis=1))])
ROWS = [SimpleNamespace(variables=list(x), objectives=list(f)) for x, f in zip(X, VALUES, strict=True)]
TRIALS = [
    SimpleNamespace(params={f"x{at}": value for at, value in enumerate(x, 1)}, values=list(f))
    for x, f in zip(X, VALUES, strict=True)
]


@pytest.mark.parametrize(
    "result",
    [
        X,
        X.tolist(),
        pd.DataFrame(X, columns=["x1", "x2", "x3"]),
        SimpleNamespace(X=X, F=VALUES),
        SimpleNamespace(X=X, F=VALUES, front=lambda: VALUES),
        SimpleNamespace(get_x=lambda: X, get_f=lambda: VALUES),
        SimpleNamespace(best_trials=TRIALS),
        ROWS,
        SimpleNamespace(result=ROWS),
        SimpleNamespace(result=lambda: ROWS),
    ],
    ids=["array", "list", "frame", "pymoo", "VAMOS", "pygmo", "optuna", "solutions", "platypus", "jmetalpy"],
)
def test_results_by_what_they_have(result: Any) -> None:
    found = tolevo.certify(Costs(), result, **FEW, forms=False)
    np.testing.assert_allclose(found.points[["f1", "f2"]], VALUES)
    assert not any("other objectives" in line for line in found.lines)


@pytest.mark.parametrize(
    ("result", "message"),
    [
        (X[:, :2], r"must have the shape \(points, 3\)"),
        (X + 2.0, "row 1, column x1: must be at most 2"),
        ("nothing", "holds no designs"),
        (SimpleNamespace(X=None, F=None), "no feasible design was found"),
        (pd.DataFrame({"x1": [0.5]}), "x2 is missing"),
    ],
)
def test_results_that_are_none(result: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        tolevo.certify(Costs(), result, **FEW)


def test_other_objectives_than_those_of_the_problem_are_told() -> None:
    found = tolevo.certify(Costs(), SimpleNamespace(X=X, F=-VALUES), **FEW, forms=False)
    assert any("states other objectives than the problem computes" in line for line in found.lines)


def test_declared_forms_count_where_there_are_some() -> None:
    cost = {"model": "reciprocal", "a": 1.0, "b": 0.1}
    part: dict[str, Any] = {"sensitivity": 1.0, "nominal": 5.0, "t_min": 0.01, "t_max": 0.2, "cost": cost}
    stack: dict[str, Any] = {"problem": "stack", "requirement": {"name": "gap", "unit": "mm"}}
    stack |= {"objectives": {"minimise": ["cost", "variation"]}, "part": [part | {"name": "a"}, part | {"name": "b"}]}
    found = tolevo.certify(stack, np.array([[0.1, 0.1], [0.05, 0.2]]), **FEW)
    # two equal parts at equal variation: the least cost has equal tolerances
    least = 2.0 + 0.2 / (np.hypot(0.05, 0.2) / np.sqrt(2.0))
    assert found.points["bound"].tolist() == pytest.approx([4.0, least], rel=1e-6)
    assert found.points["gap_percent"][0] == pytest.approx(0.0, abs=1e-6)


def test_the_bounded_column_is_the_further_cost_that_is_minimised() -> None:
    """CO2 of two equal parts at equal variation is least with equal tolerances."""
    cost, co2 = ({"model": "reciprocal", "a": a, "b": b} for a, b in ((1.0, 0.1), (0.5, 0.2)))
    part: dict[str, Any] = {"sensitivity": 1.0, "nominal": 5.0, "t_min": 0.01, "t_max": 0.2, "cost": cost}
    stack: dict[str, Any] = {"problem": "stack", "requirement": {"name": "gap", "unit": "mm"}}
    stack |= {"objectives": {"minimise": ["variation", "co2_kg"]}, "part": [part | {"name": "a"}, part | {"name": "b"}]}
    stack |= {"cost": [{"name": "co2_kg", "unit": "kg", "curves": {"a": co2, "b": co2}}]}
    found = tolevo.certify(stack, np.array([[0.05, 0.2]]), **FEW)
    least = 1.0 + 0.4 / (np.hypot(0.05, 0.2) / np.sqrt(2.0))
    assert found.bounded == "co2_kg"
    assert found.points["bound"].tolist() == pytest.approx([least], rel=1e-6)
    assert found.points["gap_percent"].tolist() == pytest.approx([100.0 * (6.0 / least - 1.0)], rel=1e-5)


def rows(function: Any, variables: int = 3) -> Any:
    x = designs_to_fit(LOW[:variables], HIGH[:variables], np.random.default_rng(1))
    return [row.kind for row in fitted(x, function(x))]


def test_forms_are_recognised_and_others_are_not() -> None:
    assert rows(lambda x: 3.0 + x @ A)[0] == "linear"
    assert rows(lambda x: (x @ A) ** 2 - x[:, 0])[0] == "convex quadratic"
    assert rows(lambda x: x[:, 0] * x[:, 1] + 1.0 / x[:, 2]) == ["posynomial"]
    assert rows(lambda x: 2.0 * x[:, 0] ** 0.7 / x[:, 1] ** 1.3) == ["monomial"]
    for function in (
        lambda x: -((x @ A) ** 2),
        lambda x: np.sin(x).sum(axis=1),
        lambda x: np.maximum(x[:, 0], x[:, 1]),
    ):
        assert rows(function) == []
    bumpy = lambda x: x @ A + 1e-5 * (x[:, 0] > 1.8)  # noqa: E731 - agrees in nine tenths of the box
    assert HELD_OUT == 400
    assert rows(bumpy) == []


def test_least_values_are_bounds_whatever_the_start() -> None:
    x = designs_to_fit(LOW, HIGH, np.random.default_rng(2))
    cost = fitted(x, (A / x).sum(axis=1))[0]
    variation = fitted(x, np.sqrt(((B * x) ** 2).sum(axis=1)))[0]
    exact = least_cost(2.0)
    for start in (LOW, HIGH, 0.5 * (LOW + HIGH)):
        bound, _ = least_value([cost, variation], np.array([2.0]), (LOW, HIGH), start)
        assert exact * (1.0 - 1e-6) <= bound <= exact * (1.0 + 1e-12)
    assert least_value([cost, variation], np.array([0.1]), (LOW, HIGH), LOW)[0] == np.inf  # nothing is so tight


def test_what_a_run_reports_as_kept_is_kept(tmp_path: Any) -> None:
    """The coarse lattice of a search has the backlash 1e-6 beyond a limit that the reported value meets."""
    table = {"problem": "rv_backlash", "references": "none", "objectives": {"minimise": ["cost"]},
             "limits": {"backlash_arcmin": 1.3, "interference_probability": 0.2},
             "algorithm": {"name": "exact", "points": 2}}  # fmt: skip
    front = tolevo.run(table).front
    found = tolevo.certify(tolevo.read(table), front, **FEW)
    assert found.points["feasible"].tolist() == [True]
    assert "designs keep the limits" not in str(found)
    assert "inf" not in str(found)


class OnALine(Problem):
    """The point of a line that is next to the origin: x1 + x2 = `total`, which is stated by either sign."""

    def __init__(self, sign: float, total: float = 1.0) -> None:
        super().__init__(n_var=2, n_obj=1, n_eq_constr=1, xl=0.0, xu=2.0)
        self.sign, self.total = sign, total

    def _evaluate(self, x: Any, out: Any, *args: Any, **kwargs: Any) -> None:
        out["F"], out["H"] = (x**2).sum(axis=1)[:, None], self.sign * (x.sum(axis=1) - self.total)[:, None]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_linear_equality_counts_from_both_sides(sign: float) -> None:
    """The least value is 1/2, less what an equality may be missed by."""
    found = tolevo.certify(OnALine(sign), np.array([[0.5, 0.5], [0.2, 0.8]]), **FEW)
    assert found.points["bound"].tolist() == pytest.approx([0.5, 0.5], abs=2e-4)
    assert (found.points["bound"] < 0.5).all()


def test_a_least_value_of_zero_has_no_percentage() -> None:
    found = tolevo.certify(OnALine(1.0, total=0.0), np.array([[0.0, 0.0], [1e-5, 5e-5]]), **FEW)
    assert found.points["bound"].tolist() == pytest.approx([0.0, 0.0], abs=1e-9)
    assert found.points["gap_percent"].isna().all()
    assert "above its least value" not in str(found)


def test_a_result_better_than_the_other_algorithm_is_told_below_it() -> None:
    """At 100 evaluations hybrid has not found the tightest corner, which is the result."""
    found = tolevo.certify(Costs(), np.array([HIGH]), seeds=1, evaluations=100)
    (line,) = [line for line in found.lines if line.startswith("best known")]
    side = "below" if found.points["distance_percent"].iloc[0] < 0.0 else "above"
    assert re.fullmatch(
        rf"best known: in the median f1 is [\d.e-]+ % {side} what hybrid found from 1 seed at no worse values of the "
        rf"others, at the worst point [\d.e-]+ % {side}; that is no bound",
        line,
    )
