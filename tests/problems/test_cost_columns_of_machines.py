"""Further costs of parts that machines make: own formulas of good parts, enumeration of every way and limit."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.special import ndtr

import tolevo
from tolevo.configuration.reader import read
from tolevo.errors import InputError
from tolevo.models.machines import (
    ConvexHull,
    GoodPartsByLimit,
    GoodPartsBySpread,
    Inspection,
    Machine,
    Rework,
    at_prices,
    convex_cost,
)
from tolevo.problems.cost_columns import column_values

REWORK = {"price": 0.8, "success": 0.9, "side": "upper"}
LATHE = {"name": "lathe", "sigma": 4.0, "price": 2.0, "inspection": {"price": 0.3, "u": 0.3, "rework": REWORK}}
GRINDER = {"name": "grinder", "sigma": 1.3, "price": 6.5}
REAMER = {"name": "reamer", "sigma": 3.0, "price": 1.5, "inspection": {"price": 0.2, "scrap": False}}
HONED = {"name": "honed", "t_min": 2.0, "t_max": 12.0, "cost": {"model": "reciprocal", "a": 1.0, "b": 9.0}}
CO2: dict[str, Any] = {
    "name": "co2_kg",
    "unit": "kg",
    "curves": {
        "shaft": {"lathe": {"price": 2.5, "inspection": 0.02, "rework": 0.3}, "grinder": 0.9},
        "bore": {"honed": {"model": "reciprocal", "a": 0.1, "b": 2.0}, "reamer": {"price": 1.2, "inspection": 0.05}},
    },
}
STACK: dict[str, Any] = {
    "problem": "stack",
    "references": "none",
    "requirement": {"name": "gap", "unit": "um"},
    "objectives": {"minimise": ["cost"]},
    "limits": {"variation": 12.0},
    "algorithm": {"name": "exact", "points": 4},
    "cost": [CO2, {"name": "total", "weights": {"cost": 1.0, "co2_kg": 3.0}}],
    "part": [
        {"name": "shaft", "unit": "um", "sensitivity": -1.0, "count": 2, "machine": [LATHE, GRINDER]},
        {"name": "bore", "unit": "um", "sensitivity": 1.0, "process": [HONED], "machine": [REAMER]},
    ],
}
T = np.geomspace(2.6, 12.0, 9)


def changed(**tables: Any) -> dict[str, Any]:
    return copy.deepcopy(STACK) | tables


def with_curves(**curves: Any) -> list[Any]:
    return [CO2 | {"curves": {**CO2["curves"], **curves}}]


def good_parts(t: Any, sigma: float, u: float) -> tuple[Any, Any, Any]:
    """Yield, three standard deviations of good parts, and the share above the limit, by docs/stack.md."""
    size, w = np.hypot(sigma, u), t - 1.645 * u
    b, r = w / size, sigma**2 / size**2
    passed = ndtr(b) - ndtr(-b)
    density = np.exp(-0.5 * b**2) / np.sqrt(2.0 * np.pi)
    return passed, 3.0 * np.sqrt(r**2 * size**2 * (1.0 - 2.0 * b * density / passed) + r * u**2), ndtr(-b)


def lathe(t: Any) -> tuple[Any, Any, Any]:
    """Cost, CO2 and spread of an inspected and reworked part of the lathe."""
    passed, spread, q = good_parts(t, 4.0, 0.3)
    good = passed + q * 0.9
    return (2.3 + q * (0.8 + 0.3)) / good, (2.52 + q * (0.3 + 0.02)) / good, spread


def reamer(t: Any) -> tuple[Any, Any, Any]:
    """The same of the reamer, whose rejected parts are used elsewhere."""
    passed, spread, _ = good_parts(t, 3.0, 0.0)
    return 1.5 + 0.2 / passed, 1.2 + 0.05 / passed, spread


SHAFT: list[tuple[float, float, Callable[..., Any]]] = [
    (12.0, 12.0, lambda t: (2.0 + 0.0 * t, 2.5 + 0.0 * t, t)),
    (0.49350 + 0.5 * np.hypot(4.0, 0.3), 0.49350 + 4.0 * np.hypot(4.0, 0.3), lathe),
    (3.9, 3.9, lambda t: (6.5 + 0.0 * t, 0.9 + 0.0 * t, t)),
]
BORE: list[tuple[float, float, Callable[..., Any]]] = [
    (2.0, 12.0, lambda t: (1.0 + 9.0 / t, 0.1 + 2.0 / t, t)),
    (9.0, 9.0, lambda t: (1.5 + 0.0 * t, 1.2 + 0.0 * t, t)),
    (1.5, 12.0, reamer),
]


def least(of: Callable[[Any, Any], Any], variation: float, co2: float = np.inf, points: int = 1500) -> float:
    """The least value on a fine grid in each of nine choices: an upper bound of the least one."""
    best = np.inf
    for shaft, bore in product(SHAFT, BORE):
        first, second = (
            np.linspace(low, high, points if low < high else 1).reshape(shape)
            for (low, high, _), shape in ((shaft, (-1, 1)), (bore, (1, -1)))
        )
        (a, b, x), (c, d, y) = shaft[2](first), bore[2](second)
        cost, carbon = 2.0 * a + c, 2.0 * b + d
        kept = (2.0 * x**2 + y**2 <= variation**2) & (carbon <= co2)
        best = min(best, float(np.min(of(cost, carbon)[kept], initial=np.inf)))
    return best


def test_columns_are_of_good_parts() -> None:
    """Every way of making both parts, evaluated as a table of designs."""
    ways = {"lathe": (0, 12.0), "lathe, inspected": (1, 6.0), "grinder": (2, 3.9)}
    bores = {"honed": (0, 5.0), "reamer": (1, 9.0), "reamer, inspected": (2, 4.0)}
    rows = list(product(ways.items(), bores.items()))
    table = pd.DataFrame(
        [{"shaft_t": s[1], "shaft_process": a, "bore_t": b[1], "bore_process": c} for (a, s), (c, b) in rows]
    )
    found = tolevo.evaluate(STACK, table)
    shafts, made = ([of[at][2](np.array(t)) for at, t in each] for of, each in (
        (SHAFT, [s for (_, s), _ in rows]), (BORE, [b for _, (_, b) in rows])))  # fmt: skip
    cost, carbon = (np.array([2.0 * s[at] + b[at] for s, b in zip(shafts, made, strict=True)]) for at in (0, 1))
    np.testing.assert_allclose(found["cost"], cost, rtol=1e-12)
    np.testing.assert_allclose(found["co2_kg"], carbon, rtol=1e-12)
    np.testing.assert_allclose(found["total"], cost + 3.0 * carbon, rtol=1e-12)


def test_slopes_are_those_of_differences() -> None:
    problem = read(STACK).problem
    assert problem is not None
    design, step = np.array([[6.0, 1.0, 4.0, 2.0]]), 1e-5
    order = [("shaft_t", "shaft_process", "bore_t", "bore_process").index(name) for name in problem.names]
    design = design[:, order]
    for name in ("co2_kg", "total"):
        for variable in ("shaft_t", "bore_t"):
            at = problem.names.index(variable)
            ends = [problem.outputs_of(design + side * step * np.eye(4)[at])[name][0] for side in (1.0, -1.0)]
            assert problem.slopes(design)[name][0, at] == pytest.approx((ends[0] - ends[1]) / (2.0 * step), rel=1e-6)


@pytest.mark.parametrize(
    ("objective", "limits", "of"),
    [
        ("co2_kg", {"variation": 12.0}, lambda cost, co2: co2),
        ("total", {"variation": 12.0}, lambda cost, co2: cost + 3.0 * co2),
        ("cost", {"variation": 12.0, "co2_kg": 5.0}, lambda cost, co2: cost),
    ],
)
def test_each_column_is_minimised_with_a_proof(objective: str, limits: dict[str, float], of: Any) -> None:
    row = tolevo.run(changed(objectives={"minimise": [objective]}, limits=limits)).front.iloc[0]
    best = least(of, 12.0, limits.get("co2_kg", np.inf))
    assert row["bound"] <= best
    assert row[objective] <= best * (1.0 + 1e-9)
    assert row[objective] == pytest.approx(row["bound"], rel=1e-6)
    assert row[objective] == pytest.approx(best, rel=2e-3)  # the grid has 1500 limits of inspection
    assert row["co2_kg"] <= limits.get("co2_kg", np.inf) * (1.0 + 1e-9)


@pytest.mark.slow
def test_fronts_of_three_objectives_leave_no_gap() -> None:
    front = tolevo.run(changed(objectives={"minimise": ["cost", "co2_kg", "variation"]}, limits={})).front
    assert len(front) >= 3
    assert front["gap_percent"].max() < 1e-4
    for _, point in front.iterrows():
        best = least(
            lambda cost, co2: cost, float(point["variation"]) * (1 + 1e-9), float(point["co2_kg"]) * (1 + 1e-9)
        )
        assert point["bound"] <= best * (1.0 + 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["nsga2", "ga", "hybrid"])
def test_other_algorithms_take_them(name: str) -> None:
    settings = {"name": name} | ({} if name == "hybrid" else {"population": 20, "generations": 20})
    objectives = ["cost"] if name == "ga" else ["cost", "co2_kg"]
    result = tolevo.run(changed(objectives={"minimise": objectives}, limits={"variation": 12.0, "co2_kg": 6.0},
                                algorithm=settings))  # fmt: skip
    front = result.front
    assert (front["co2_kg"] <= 6.0 * (1.0 + 1e-9)).all()
    for _, point in front.iloc[:: max(1, len(front) // 4)].iterrows():
        most = 6.0 if name == "ga" else float(point["co2_kg"]) * (1 + 1e-9)
        assert point["bound"] <= least(lambda cost, co2: cost, 12.0, most) * (1.0 + 1e-9)
        assert point["bound"] <= point["cost"] * (1.0 + 1e-9)


def test_units_and_hours_and_set_ups_are_prices_of_a_piece() -> None:
    setup = {"price": 0.0, "lot": 40}
    parts = copy.deepcopy(STACK["part"])
    parts[0]["machine"][1]["setup"] = setup
    hours = {"per_hour": "9000 g/h", "time": "5 min", "setup": 6.0}
    stated = with_curves(shaft={"lathe": {"price": "2500 g", "inspection": "20 g", "rework": 0.3}, "grinder": hours})
    first = read(changed(cost=stated, part=parts)).problem
    second = read(changed(part=parts)).problem
    assert first is not None
    assert second is not None
    for one, other in zip(*(p.settings.cost_columns[0].curves["shaft_t"] for p in (first, second)), strict=True):
        np.testing.assert_allclose(one.cost(T), other.cost(T), rtol=1e-12)


def test_the_order_of_parts_and_machines_changes_nothing() -> None:
    parts = [part | {"machine": part["machine"][::-1]} for part in STACK["part"][::-1]]
    limits, objectives = {"variation": 12.0}, {"minimise": ["total"]}
    tables = changed(part=parts, limits=limits, objectives=objectives)
    tables["cost"][0]["curves"] = dict(reversed(CO2["curves"].items()))
    one, other = (tolevo.run(t).front.iloc[0] for t in (tables, changed(limits=limits, objectives=objectives)))
    for name in ("total", "cost", "co2_kg", "bound"):
        assert one[name] == pytest.approx(other[name], rel=1e-9)


def test_the_resolved_configuration_states_the_same_columns() -> None:
    resolved = tomllib.loads(tolevo.check(STACK))
    assert resolved["cost"][0]["curves"]["shaft_t"]["lathe"] == {"price": 2.5, "inspection": 0.02, "rework": 0.3}
    again, first = read(resolved).problem, read(STACK).problem
    assert again is not None
    assert first is not None
    assert again.settings.cost_columns == first.settings.cost_columns


@pytest.mark.parametrize(
    ("curves", "place", "message"),
    [
        ({"shaft": {"lathe": 0.4}}, "shaft.grinder", "is missing"),
        ({"shaft": 0.4}, "shaft", "must be a table"),
        ({"bore": {"honed": 0.4}}, "bore.reamer", "is missing"),
        ({"shaft": {"lathe": "2 s", "grinder": 1.0}}, "shaft.lathe", "unit of kg"),
        (
            {"shaft": {"lathe": {"price": 1.0, "inspection": -1.0}, "grinder": 1.0}},
            "shaft.lathe.inspection",
            "at least",
        ),
        ({"shaft": {"lathe": 1.0, "grinder": {"price": 1.0, "rework": 1.0}}}, "shaft.grinder.rework", "leave it out"),
        ({"shaft": {"lathe": 1.0, "grinder": {"price": 1.0, "setup": 1.0}}}, "shaft.grinder.setup", "leave it out"),
        ({"shaft": {"lathe": {"per_hour": 1.0}, "grinder": 1.0}}, "shaft.lathe.time", "state both"),
        ({"shaft": {"lathe": {"inspection": 1.0}, "grinder": 1.0}}, "shaft.lathe.price", "either price"),
        ({"shaft": {"lathe": {"price": 1.0, "coolant": 1.0}, "grinder": 1.0}}, "shaft.lathe.coolant", "not a known"),
        ({"shaft": {"lathe": 1.0, "grindr": 1.0, "grinder": 1.0}}, "shaft.grindr", "did you mean `grinder`"),
    ],
)
def test_faults_have_their_place(curves: dict[str, Any], place: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        read(changed(cost=with_curves(**curves)))
    assert [f.place for f in error.value.faults if message in f.message] == [f"cost[0].curves.{place}"]


def test_faulty_machines_raise_no_faults_of_their_further_costs() -> None:
    tables = changed()
    del tables["part"][0]["machine"][0]["sigma"]
    with pytest.raises(InputError) as error:
        read(tables)
    assert [fault.place for fault in error.value.faults] == ["part[0].machine[0].sigma"]


CURVE = {"model": "reciprocal", "a": 1.0, "b": 2.0}
PRICES = "whose scatter does not depend on t: state price"


@pytest.mark.parametrize(
    ("curves", "place", "message"),
    [
        ({"shaft": 1.0}, "shaft", "must be a table with a value for each of lathe, grinder, got 1.0"),
        ({"shaft": "x"}, "shaft", 'must be a table with a value for each of lathe, grinder, got "x"'),
        ({"bore": [1]}, "bore", "must be a table with a value for each of honed, reamer, got [1]"),
        ({"shaft": CURVE}, "shaft", f"has machines, {PRICES} of each of lathe, grinder"),
        ({"bore": CURVE}, "bore", f"has machines, {PRICES} of each of reamer, and a curve of each of honed"),
        ({"shaft": {"lathe": CURVE, "grinder": 1.0}}, "shaft.lathe", f"is a machine, {PRICES}"),
    ],
)
def test_what_machines_cannot_have_is_one_fault(curves: dict[str, Any], place: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        read(changed(cost=with_curves(**curves)))
    assert [(f.place, f.message) for f in error.value.faults] == [(f"cost[0].curves.{place}", message)]


@pytest.mark.parametrize("name", [None, "", 3, "grinder"])
@pytest.mark.parametrize("inspected", [False, True])
def test_machines_without_a_name_of_their_own_raise_no_faults_of_their_further_costs(
    name: object, inspected: bool
) -> None:
    tables = changed()
    machine = tables["part"][0]["machine"][0]
    machine["name"] = name
    if name is None:
        del machine["name"]
    if not inspected:
        del machine["inspection"]
    with pytest.raises(InputError) as error:
        read(tables)
    place = f"part[0].machine[{1 if name == 'grinder' else 0}].name"
    assert {fault.place for fault in error.value.faults} == {place}


def test_curves_of_machines_fall_so_that_the_ends_are_the_least_and_the_largest() -> None:
    """Yields and rejects of a normal scatter off centre, on a grid and reworked on any side."""
    t = np.linspace(0.5, 12.0, 2001)
    for side in ("upper", "lower", "both"):
        for price, inspection, rework in product((0.0, 2.0), (0.0, 0.3), (0.0, 9.0)):
            low, high = ndtr((-t - 0.7) / 1.5), ndtr(-(t - 0.7) / 1.5)
            again = {"upper": high, "lower": low, "both": low + high}[side]
            good = 1.0 - low - high + 0.9 * again
            cost = (price + inspection + again * (rework + inspection)) / good
            machine = Machine("m", 1.5, price, 0.7, Inspection(inspection, 0.0, rework=Rework(rework, 0.9, side)))
            np.testing.assert_allclose(GoodPartsByLimit(machine).cost(t), cost, rtol=1e-9)
            assert np.all(np.diff(cost) <= 1e-12 * cost[:-1])


def test_a_hull_at_other_prices_lies_below_the_cost_there() -> None:
    """Where limits are so wide that the cost with rework is not convex, at prices of its own and at others."""
    inspected = Inspection(0.3, 0.0, rework=Rework(3.0, 0.95, "both"))
    machine = Machine("m", 1.0, 2.0, 0.8, inspected)
    curve = GoodPartsBySpread(machine, 0.6, 7.0, 3.0)
    hull, exact = convex_cost(curve, curve.tabulated)
    assert not exact
    assert isinstance(hull, ConvexHull)
    for prices in ((5.0, 0.0, 0.1), (0.1, 0.0, 4.0), (0.0, 0.0, 0.0)):
        other = machine.with_prices(*prices)
        priced, x = at_prices(hull.of, other, 0.6, 7.0), np.linspace(*curve.ends, 5001)[1:-1]
        true = GoodPartsBySpread(other, 0.6, 7.0, 3.0).cost(x)
        assert np.all(priced.cost(x) <= true + 1e-9 * np.max(true))


def test_a_form_of_another_problem_has_the_column_of_its_machines() -> None:
    """The form of a weighted sum has, at the machine of a backlash, the value that the outputs have."""
    machines = [
        {"name": "one", "sigma": 1.5, "price": 20.0, "inspection": {"price": 1.0, "required": True}},
        {"name": "two", "sigma": 0.8, "price": 60.0},
    ]
    column = {"name": "co2_kg", "curves": {"pin_radius_um": {"one": {"price": 3.0, "inspection": 0.5}, "two": 4.0}}}
    problem = read({"problem": "rv_backlash", "variables": {"pin_radius_um": {"machine": machines}}, "cost": [column],
                    "limits": {}}).problem  # fmt: skip
    assert problem is not None
    form = problem.form()
    assert form is not None
    weighted = problem.weighted_form(form, {"cost": 1.0, "co2_kg": 3.0})
    assert weighted is not None
    at = next(at for at, feature in enumerate(form.features) if feature.variable == "pin_radius_um")
    for own, both in zip(form.features[at].ways, weighted.features[at].ways, strict=True):
        made: Any = own.curve
        spread = np.linspace(own.low, own.high, 5)
        passed: Any = 1.0
        if own.choice == 0.0:
            t = np.interp(spread, GoodPartsBySpread(made.machine, 0.75, 6.0, 3.0)._table[1],
                          np.linspace(0.75, 6.0, 2049))  # fmt: skip
            passed = ndtr(t / 1.5) - ndtr(-t / 1.5)
        more = 3.0 * (3.5 / passed if own.choice == 0.0 else 4.0)
        np.testing.assert_allclose(both.curve.cost(spread), own.curve.cost(spread) + more, rtol=1e-6)
    design = np.array([[0.5 * sum(problem.interval(name)) for name in problem.names]])
    design[0, problem.names.index("pin_radius_process")] = 1.0
    design[0, problem.names.index("pin_radius_um")] = 2.4
    assert column_values(problem, design, problem.cost_of(design))["co2_kg"][0] == 4.0
