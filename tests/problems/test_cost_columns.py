"""Further costs: values by hand, bounds against SLSQP of scipy and against enumeration, forms of other problems."""

from __future__ import annotations

import copy
import tomllib
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import optimize

import tolevo
from tolevo.algorithms.archive import nondominated
from tolevo.algorithms.exact.epsilon import choose_among_integer_sets
from tolevo.algorithms.run import Run
from tolevo.algorithms.settings import Budget
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.models.cost_reading import SumOfCurves, add_constant_cost, times, weighted_sum
from tolevo.models.costs import CostCurve, Exponential, Reciprocal, ReciprocalPower, ReciprocalSquared, Table

minimize: Any = optimize.minimize  # its stubs know arrays of one fixed dimension only

PARTS = [
    {"name": "a", "count": 2, "sensitivity": 1.0, "cost": {"model": "reciprocal", "a": 1.0, "b": 0.1}},
    {"name": "b", "sensitivity": -1.5, "cost": {"model": "reciprocal", "a": 1.0, "b": 0.1}},
    {"name": "c", "sensitivity": 0.5, "cost": {"model": "exponential", "a": 0.5, "b": 3.0, "m": 12.0}},
]
CO2 = {
    "name": "co2_kg",
    "unit": "kg",
    "curves": {
        "a": {"model": "reciprocal_squared", "a": 0.2, "b": 0.0004},
        "b": {"model": "reciprocal", "a": 1.0, "b": 0.004},
        "c": {"model": "reciprocal", "a": 0.1, "b": 0.3},
    },
}
TOTAL = {"name": "total", "unit": "EUR", "weights": {"cost": 1.0, "co2_kg": 2.5}}
STACK: dict[str, Any] = {
    "problem": "stack",
    "references": "none",
    "currency": "EUR",
    "requirement": {"name": "gap", "unit": "mm"},
    "objectives": {"minimise": ["cost"]},
    "limits": {"variation": 0.2},
    "algorithm": {"name": "exact", "points": 8},
    "cost": [CO2, TOTAL],
    "part": [part | {"nominal": 5.0, "unit": "mm", "t_min": 0.01, "t_max": 0.3} for part in PARTS],
}
SIGMA = np.array([np.sqrt(2.0), 1.5, 0.5])


def changed(**tables: Any) -> dict[str, Any]:
    return copy.deepcopy(STACK) | tables


def cost(t: Any) -> Any:
    return 2.0 * (1.0 + 0.1 / t[0]) + 1.0 + 0.1 / t[1] + 0.5 + 3.0 * np.exp(-12.0 * t[2])


def co2(t: Any) -> Any:
    return 2.0 * (0.2 + 0.0004 / t[0] ** 2) + 1.0 + 0.004 / t[1] + 0.1 + 0.3 / t[2]


def least(of: Any, most: float = np.inf, variation: float = 0.2) -> float:
    """The least value by SLSQP of scipy in logarithms, where both costs are convex."""
    rows: list[dict[str, Any]] = [
        {"type": "ineq", "fun": lambda y: 1.0 - np.sqrt(np.sum((SIGMA * np.exp(y)) ** 2)) / variation}
    ]
    rows += [{"type": "ineq", "fun": lambda y: 1.0 - co2(np.exp(y)) / most}] if np.isfinite(most) else []
    found = [
        minimize(
            lambda y: of(np.exp(y)),
            np.log([start] * 3),
            bounds=[(np.log(0.01), np.log(0.3))] * 3,
            constraints=rows,
            method="SLSQP",
            options={"maxiter": 1000, "ftol": 1e-14},
        )
        for start in (0.03, 0.08)
    ]
    return min(float(one.fun) for one in found if all(row["fun"](one.x) > -1e-8 for row in rows))


def test_columns_are_sums_of_their_curves() -> None:
    found = tolevo.evaluate(STACK, pd.DataFrame({"a_t": [0.05], "b_t": [0.1], "c_t": [0.2]}))
    t = np.array([0.05, 0.1, 0.2])
    assert found["cost"][0] == pytest.approx(cost(t), rel=1e-12)
    assert found["co2_kg"][0] == pytest.approx(co2(t), rel=1e-12)
    assert found["total"][0] == pytest.approx(cost(t) + 2.5 * co2(t), rel=1e-12)


@pytest.mark.parametrize(
    ("objective", "limits", "of"),
    [
        ("cost", {"variation": 0.2, "co2_kg": 3.4}, cost),
        ("co2_kg", {"variation": 0.2}, co2),
        ("total", {"variation": 0.2}, lambda t: cost(t) + 2.5 * co2(t)),
        ("total", {"variation": 0.2, "co2_kg": 3.2}, lambda t: cost(t) + 2.5 * co2(t)),
    ],
)
def test_each_column_is_minimised_with_a_proof(objective: str, limits: dict[str, float], of: Any) -> None:
    result = tolevo.run(changed(objectives={"minimise": [objective]}, limits=limits))
    row, reference = result.front.iloc[0], least(of, limits.get("co2_kg", np.inf))
    assert row[objective] == pytest.approx(reference, rel=1e-6)
    assert row["bound"] <= reference * (1.0 + 1e-9)
    assert row["bound"] == pytest.approx(reference, rel=1e-6)
    assert row["co2_kg"] <= limits.get("co2_kg", np.inf) * (1.0 + 1e-9)


@pytest.mark.slow
def test_a_front_of_both_costs_is_proven_at_every_point() -> None:
    result = tolevo.run(changed(objectives={"minimise": ["cost", "co2_kg"]}))
    front = result.front
    assert len(front) >= 8
    for _, row in front.iloc[:: max(1, len(front) // 5)].iterrows():
        reference = least(cost, float(row["co2_kg"]))
        assert row["bound"] <= reference * (1.0 + 1e-7)
        assert row["bound"] == pytest.approx(reference, rel=2e-3)
    assert front["gap_percent"].median() < 0.05


def test_processes_have_curves_of_their_own_and_bounds_hold_for_every_choice() -> None:
    """The bound at a limit on CO2 is below the best of a fine grid over every process."""
    tables = changed(limits={"variation": 0.25, "co2_kg": 3.0}, cost=[copy.deepcopy(CO2)])
    tables["part"][2] = {
        "name": "c",
        "nominal": 5.0,
        "unit": "mm",
        "sensitivity": 0.5,
        "process": [
            {"name": "turned", "t_min": 0.1, "t_max": 0.3, "cost": {"model": "reciprocal", "a": 1.0, "b": 0.2}},
            {"name": "ground", "t_min": 0.02, "t_max": 0.15, "cost": {"model": "reciprocal", "a": 2.0, "b": 0.1}},
        ],
    }
    tables["cost"][0]["curves"]["c"] = {"turned": 0.4, "ground": {"model": "reciprocal", "a": 0.9, "b": 0.01}}
    result = tolevo.run(tables)
    row = result.front.iloc[0]
    axes = np.geomspace(0.01, 0.3, 60), np.geomspace(0.01, 0.3, 60), np.geomspace(0.02, 0.3, 60)
    grid = np.array(list(product(*axes))).T
    best = np.inf
    for low, high, price, emitted in (
        (0.1, 0.3, 1.0 + 0.2 / grid[2], 0.4),
        (0.02, 0.15, 2.0 + 0.1 / grid[2], 0.9 + 0.01 / grid[2]),
    ):
        kept = (grid[2] >= low) & (grid[2] <= high) & (np.sqrt(((SIGMA[:, None] * grid) ** 2).sum(0)) <= 0.25)
        carbon = 2.0 * (0.2 + 0.0004 / grid[0] ** 2) + 1.0 + 0.004 / grid[1] + emitted
        whole = 2.0 * (1.0 + 0.1 / grid[0]) + 1.0 + 0.1 / grid[1] + price
        best = min(best, float(np.min(whole[kept & (carbon <= 3.0)], initial=np.inf)))
    assert row["bound"] <= best
    assert row["cost"] <= best
    assert row["cost"] == pytest.approx(row["bound"], rel=1e-6)


TURNED, GROUND = (0.05, 0.3, 1.0, 0.2, 2.0, 0.02), (0.01, 0.2, 1.6, 0.08, 0.3, 0.1)
"""Two processes: the range of t, cost a + b/t, and CO2 a + b/t."""


def least_of_two(carbon: float, variation: float) -> float:
    """The least cost of two parts by SLSQP in each choice of processes."""
    best = np.inf
    for chosen in product((TURNED, GROUND), repeat=2):
        low, high, a, b, c, d = np.array(chosen).T
        rows: list[dict[str, Any]] = [
            {"type": "ineq", "fun": lambda t, c=c, d=d: carbon - float(np.sum(c + d / t)) + 1e-9},
            {"type": "ineq", "fun": lambda t: 1.0 - float(np.hypot(*t)) / variation + 1e-9},
        ]
        for share in (0.1, 0.5, 0.9):
            start, ends = low + share * (high - low), list(zip(low, high, strict=True))
            one = minimize(lambda t, a=a, b=b: float(np.sum(a + b / t)), start, bounds=ends, constraints=rows)
            if all(row["fun"](one.x) >= -1e-8 for row in rows):
                best = min(best, float(one.fun))
    return best


def three_objectives() -> dict[str, Any]:
    """Two parts, each in two processes, with cost, CO2 and variation to be minimised."""
    ways, emitted = [], {}
    for name, (low, high, a, b, c, d) in {"turned": TURNED, "ground": GROUND}.items():
        ways.append({"name": name, "t_min": low, "t_max": high, "cost": {"model": "reciprocal", "a": a, "b": b}})
        emitted[name] = {"model": "reciprocal", "a": c, "b": d}
    parts = [{"name": n, "nominal": 5.0, "unit": "mm", "sensitivity": 1.0, "process": ways} for n in ("a", "b")]
    columns = [{"name": "co2_kg", "unit": "kg", "curves": {"a": emitted, "b": emitted}}]
    return changed(objectives={"minimise": ["cost", "co2_kg", "variation"]}, limits={}, part=parts, cost=columns)


def test_fronts_of_three_objectives_with_processes_leave_no_gap() -> None:
    front = tolevo.run(three_objectives() | {"algorithm": {"name": "exact", "points": 4}}).front
    assert len(front) >= 3
    assert front["gap_percent"].max() < 1e-4
    for _, point in front.iterrows():
        best = least_of_two(float(point["co2_kg"]), float(point["variation"]))
        assert point["bound"] <= best * (1.0 + 1e-6)
        assert point["cost"] <= best * (1.0 + 1e-5)


@pytest.mark.parametrize("budget", [Budget(time_limit_s=0.0), Budget(evaluations=200)])
def test_every_set_of_integers_is_solved_within_the_budget(budget: Budget) -> None:
    """Once it is spent the points stay as they are in the archive."""
    problem = read(three_objectives() | {"algorithm": {"name": "exact", "points": 4}}).problem
    assert problem is not None
    run = Run(problem, Budget(evaluations=200, time_limit_s=1e3), seed=0)
    share = np.random.default_rng(1).uniform(size=(200, problem.n_var))
    run.evaluate(problem.xl + share * (problem.xu - problem.xl))
    run.budget = budget
    choose_among_integer_sets(run, 4)
    x, f = run.archive.arrays()
    kept = {tuple(row) for row in x[nondominated(f)].tolist()}
    assert len({tuple(row) for row in run.chosen.tolist()} & kept) == len(run.chosen) == 4
    assert run.evaluations == 200


def test_the_resolved_configuration_states_the_same_columns() -> None:
    resolved = tolevo.check(STACK)
    again, first = read(tomllib.loads(resolved)).problem, read(STACK).problem
    assert again is not None
    assert first is not None
    assert again.settings.cost_columns == first.settings.cost_columns
    assert len(again.settings.cost_columns) == 2
    assert tomllib.loads(tolevo.check(tomllib.loads(resolved))) == tomllib.loads(resolved)


def test_slopes_are_those_of_differences() -> None:
    problem = read(STACK).problem
    assert problem is not None
    design = np.array([[0.05, 0.1, 0.2]])
    slopes = problem.slopes(design)
    for name in ("co2_kg", "total"):
        for at in range(3):
            ends = [problem.outputs_of(design + side * 1e-6 * np.eye(3)[at])[name][0] for side in (1.0, -1.0)]
            assert slopes[name][0, at] == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-6)


@pytest.mark.slow
def test_genetic_algorithms_take_further_costs() -> None:
    settings = {"name": "nsga2", "population": 40, "generations": 30}
    result = tolevo.run(changed(objectives={"minimise": ["cost", "co2_kg"]}, algorithm=settings))
    assert (result.front["gap_percent"] >= 0.0).all()
    assert (result.front["bound"] <= result.front["cost"]).all()


def test_no_sentence_gives_kilograms_a_currency() -> None:
    result = tolevo.run(changed(objectives={"minimise": ["co2_kg"]}))
    text = " ".join(map(str, result.summary["answers"].values()))
    assert "least co2" in text
    assert "kg" in text
    assert "least cost within" not in text
    assert set(result.allocation.columns) >= {"cost", "co2_kg"}  # type: ignore[union-attr]
    assert result.summary["bound_of"] == "co2_kg"


@pytest.mark.parametrize(
    ("cost", "place", "message"),
    [
        ([{"unit": "kg", "curves": {"a": 1.0}}], "cost[0].name", "is missing"),
        ([CO2 | {"name": "variation"}], "cost[0].name", "another output"),
        ([CO2, CO2], "cost[1].name", "another output"),
        ([CO2 | {"name": "a b"}], "cost[0].name", "letters"),
        ([CO2 | {"weights": {"cost": 1.0}}], "cost[0].curves", "either curves"),
        ([{"name": "x"}], "cost[0].curves", "either curves"),
        ([{"name": "x", "curves": {"d": 1.0}}], "cost[0].curves.d", "no part"),
        ([{"name": "x", "curves": {"a": {"model": "reciprocal", "a": 1.0}}}], "cost[0].curves.a.b", "is missing"),
        ([{"name": "x", "curves": {"a": -1.0}}], "cost[0].curves.a", "at least 0"),
        ([{"name": "x", "weights": {"cots": 1.0}}], "cost[0].weights.cots", "cost"),
        ([{"name": "x", "weights": {"cost": 0.0}}], "cost[0].weights", "all be zero"),
        (
            [{"name": "x", "curves": {"a": {"model": "table", "t": [0.05, 0.1], "cost_at": [2.0, 1.0]}}}],
            "cost[0].curves.a",
            "finite",
        ),
        ([CO2 | {"colour": "red"}], "cost[0].colour", "not a known key"),
    ],
)
def test_faults_have_their_place(cost: Any, place: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        read(changed(cost=cost))
    assert any(fault.place == place and message in fault.message for fault in error.value.faults), error.value.faults


T = np.geomspace(0.02, 0.3, 7)


@pytest.mark.parametrize(
    "curves",
    [
        [Reciprocal(1.0, 0.2), Reciprocal(0.5, 0.1)],
        [ReciprocalPower(1.0, 0.2, 1.5), ReciprocalPower(0.5, 0.1, 1.5), Reciprocal(2.0, 0.0)],
        [Reciprocal(1.0, 0.2), ReciprocalSquared(0.5, 0.01)],
        [Exponential(1.0, 3.0, 9.0), Reciprocal(0.5, 0.02)],
        [Table((0.02, 0.1, 0.3), (5.0, 2.0, 1.0)), Reciprocal(0.5, 0.02)],
    ],
)
def test_a_weighted_sum_of_curves_is_one_curve(curves: list[Any]) -> None:
    whole = weighted_sum([(2.0, curves[0]), *((0.5, curve) for curve in curves[1:])])
    expected = 2.0 * curves[0].cost(T) + sum(0.5 * curve.cost(T) for curve in curves[1:])
    np.testing.assert_allclose(whole.cost(T), expected, rtol=1e-12)
    assert isinstance(whole, SumOfCurves) == (len({type(curve) for curve in curves}) > 1 and curves[-1].b != 0.0)
    linear, square = np.array([0.0, 1.0, 3.0]), np.array([10.0, 0.5, 0.0])
    best = whole.best(linear, square, 0.02, 0.3)
    fine = np.linspace(0.02, 0.3, 40001)
    for at in range(3):
        values = whole.cost(fine) + linear[at] * fine + square[at] * fine**2
        own = whole.cost(best[at : at + 1])[0] + linear[at] * best[at] + square[at] * best[at] ** 2
        assert own <= values.min() + 1e-10


class Own(CostCurve):
    """A curve of a plugin, whose coefficients no other module knows: 3 - t."""

    def cost(self, t: Any) -> Any:
        return 3.0 - t

    def slope(self, t: Any) -> Any:
        return -np.ones_like(t)


def test_curves_of_plugins_are_scaled_as_a_whole() -> None:
    np.testing.assert_allclose(times(Own(), 2.0).cost(T), 6.0 - 2.0 * T, rtol=1e-14)
    np.testing.assert_allclose(add_constant_cost(times(Own(), 2.0), 1.0).cost(T), 7.0 - 2.0 * T, rtol=1e-14)
    np.testing.assert_allclose(add_constant_cost(Own(), 1.0).cost(T), 4.0 - T, rtol=1e-14)
    whole = weighted_sum([(2.0, Own()), (0.5, Reciprocal(1.0, 0.2))])
    np.testing.assert_allclose(whole.cost(T), 6.5 - 2.0 * T + 0.1 / T, rtol=1e-14)
    np.testing.assert_allclose(times(whole, 3.0).cost(T), 3.0 * whole.cost(T), rtol=1e-14)


@pytest.mark.parametrize(
    ("problem", "limits", "curves"),
    [
        ("pose_accuracy", {"squareness_mrad": 0.3}, {"rod_length_1_um": 2.0, "joint_line_1_mrad": 3.0}),
        ("rv_transmission_error", {"te_amplitude_arcsec": 60.0}, {"gear_1_x_mrad": 1.0, "crankshaft_1_x_mrad": 2.0}),
        ("rv_backlash", {}, {"pin_radius_um": 2.0, "pitch_um": 3.0, "involute_grade": 1.0}),
    ],
)
def test_forms_of_other_problems_have_the_columns_as_well(
    problem: str, limits: dict[str, float], curves: dict[str, float]
) -> None:
    """The form of a weighted sum has, at its features' own t, the value that the outputs have."""
    column = {"name": "co2_kg", "curves": {n: {"model": "reciprocal", "a": 0.5, "b": b} for n, b in curves.items()}}
    tables: dict[str, Any] = {"problem": problem, "limits": limits, "cost": [column]}
    tables |= {"variables": {"precision_weight": {"value": 0.0}}} if problem == "rv_transmission_error" else {}
    known = read(tables).problem
    assert known is not None
    form = known.form()
    assert form is not None
    weighted = known.weighted_form(form, {"cost": 1.0, "co2_kg": 3.0})
    assert weighted is not None
    values = {v.name: float(known.fixed.get(v.name, np.nan)) for v in known.variables}
    total = weighted.base
    for feature in weighted.features:
        way = feature.ways[-1]
        t = 0.5 * (way.low + way.high)
        total += feature.count * float(way.curve.cost(np.array([t]))[0])
        values |= {feature.variable: t} if feature.variable else {}
        values |= {feature.choice: way.choice} if feature.choice else {}
    design = np.array([[values.get(name, np.nan) for name in known.names]])
    middle = np.array([[0.5 * sum(known.interval(name)) for name in known.names]])
    design = np.where(np.isnan(design), middle, design)
    cost = known.cost_of(design)
    from tolevo.problems.cost_columns import column_values

    assert total == pytest.approx(float(cost[0] + 3.0 * column_values(known, design, cost)["co2_kg"][0]), rel=1e-9)
