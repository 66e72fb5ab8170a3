"""Stacks whose parts are made by machines, against an enumeration of every combination."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from scipy.stats import norm, truncnorm

from tests.small_jobs import output_of, written
from tolevo.algorithms.exact.bounds import proof
from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.configuration.reader import read_table
from tolevo.errors import InputError
from tolevo.problems.stack.problem import Stack
from tolevo.problems.stack.reading import tables_of
from tolevo.problems.stack.rows import tangents

SLOPES = (0.7, 1.1, 1.5, 0.9, 1.3)
SIGMAS, PRICES = (3.6, 2.3, 1.3), (2.0, 3.6, 6.5)


def machine(part: int, at: int, **more: Any) -> dict[str, Any]:
    """A machine of a part: wider and cheaper, or finer and dearer."""
    return {"name": f"m{at}", "sigma": SIGMAS[at] * (1.0 + 0.06 * part),
            "price": PRICES[at] * (1.2 - 0.07 * part)} | more  # fmt: skip


def table(limit: float, inspected: bool = True, method: str = "rss", **more: Any) -> dict[str, Any]:
    """Five parts of three machines each."""
    given = {"inspection": {"price": 0.3}, "t_min": 1.0, "t_max": 16.0} if inspected else {}
    parts = [
        {"name": f"p{part}", "unit": "um", "sensitivity": slope,
         "machine": [machine(part, at, **given) for at in range(3)]}
        for part, slope in enumerate(SLOPES)
    ]  # fmt: skip
    return {
        "problem": "stack",
        "objectives": {"minimise": ["cost"]},
        "limits": {"variation": limit},
        "requirement": {"name": "gap", "unit": "um", "method": method, "nominal": 0.0},
        "part": parts,
    } | more


def stack(given: dict[str, Any]) -> Stack:
    problem = read_table(given, []).problem
    assert isinstance(problem, Stack)
    return problem


def solved(problem: Stack) -> tuple[float, float, dict[str, Any], np.ndarray]:
    """Cost, proven bound, outputs and design of the exact optimum, which keeps its limits."""
    found = search(problem, Exact(), Budget(), 1)
    designs = problem.complete(found.x)
    values = problem.outputs_of(designs)
    assert np.all(problem.violations(designs, values) <= 0.0)
    at = int(np.argmin(values["cost"]))
    own = {name: column[at : at + 1] for name, column in values.items()}
    bound = proof(problem, {"cost": own["cost"]}, 1).bound[0]
    return float(own["cost"][0]), float(bound), own, designs[at]


def enumerated(limit: float, inspected: bool = True) -> float:
    """Least cost over all combinations: each by a price of the variance, on a grid of prices."""
    coarse = _at_prices(limit, inspected, np.geomspace(1e-4, 1.0, 300))
    near = coarse[min(coarse)]
    return min(_at_prices(limit, inspected, near * np.geomspace(0.3, 3.0, 3000), min(coarse)))


def _at_prices(limit: float, inspected: bool, price: np.ndarray, known: float = np.inf) -> dict[float, float]:
    """Least cost of each combination, and its price; of those within 3 % of a known cost alone."""
    tau = np.linspace(0.3, 6.0, 3001)
    law = truncnorm(-tau, tau)
    std, share, nothing = np.asarray(law.std()), 2.0 * norm.cdf(tau) - 1.0, np.zeros(len(price))
    ways: list[list[tuple[np.ndarray, np.ndarray]]] = []
    for part, slope in enumerate(SLOPES):
        own = []
        for at in range(3):
            one = machine(part, at)
            sigma = one["sigma"]
            own.append((nothing + (3.0 * slope * sigma) ** 2, nothing + one["price"]))
            if not inspected:
                continue
            kept = (tau * sigma >= 1.0) & (tau * sigma <= 16.0)
            square, cost = ((3.0 * slope * sigma * std[kept]) ** 2, (one["price"] + 0.3) / share[kept])
            best = np.argmin(cost + price[:, None] * square, axis=1)
            own.append((square[best], cost[best]))
        ways.append(own)
    found = {}
    for chosen in product(*ways):
        if sum(one[1][0] for one in chosen) > 1.03 * known:  # at the least price the cheapest
            continue
        square, cost = sum(one[0] for one in chosen), sum(one[1] for one in chosen)
        kept = np.where(square <= limit**2, cost, np.inf)
        found[float(np.min(kept))] = float(price[np.argmin(kept)])
    return found


@pytest.mark.parametrize("limit", [15.0, 24.0])
def test_five_parts_of_three_machines_are_proven_to_the_enumerated_optimum(limit: float) -> None:
    best = enumerated(limit)
    cost, bound, own, _ = solved(stack(table(limit)))
    assert own["rss"][0] <= limit
    assert abs(cost / best - 1.0) < 0.002
    assert best * (1.0 - 0.002) <= bound <= best * (1.0 + 1e-9)
    assert bound <= cost <= bound * (1.0 + 1e-6)


def test_without_inspection_the_same_promise_costs_more() -> None:
    best = enumerated(15.0, inspected=False)
    cost, bound, _, _ = solved(stack(table(15.0, inspected=False)))
    np.testing.assert_allclose([cost, bound], best, rtol=1e-9)
    assert cost > 1.2 * solved(stack(table(15.0)))[0]


def test_outputs_are_those_of_the_good_parts() -> None:
    problem = stack(table(15.0))
    rng = np.random.default_rng(3)
    designs = problem.complete(rng.uniform(problem.xl, problem.xu, (20, problem.n_var)))
    values = problem.outputs_of(designs)
    for row, design in enumerate(designs):
        square, cost, worst = 0.0, 0.0, 0.0
        for part, slope in enumerate(SLOPES):
            t = design[problem.names.index(f"p{part}_t")]
            at, sorted_ = divmod(int(design[problem.names.index(f"p{part}_process")]), 2)
            one = machine(part, at)
            std, price = one["sigma"], one["price"]
            if sorted_:
                tau = t / std
                std, price = std * truncnorm(-tau, tau).std(), (price + 0.3) / (
                    2.0 * norm.cdf(tau) - 1.0)  # fmt: skip
            else:
                np.testing.assert_allclose(t, 3.0 * std)
            square, cost, worst = square + (slope * std) ** 2, cost + price, worst + slope * t
        np.testing.assert_allclose(values["rss"][row], 3.0 * np.sqrt(square), rtol=1e-10)
        np.testing.assert_allclose(values["cost"][row], cost, rtol=1e-12)
        np.testing.assert_allclose(values["worst_case"][row], worst, rtol=1e-12)


def off_centre(method: str, limits: dict[str, Any], **requirement: Any) -> dict[str, Any]:
    """Three parts whose machines are off centre."""
    found = table(12.0, method=method)
    found["part"] = found["part"][:3]
    found["limits"] = limits
    found["requirement"] |= requirement
    for at, part in enumerate(found["part"]):
        for one in part["machine"]:
            one["mean"] = (0.4, -0.3, 0.2)[at] * one["sigma"]
    return found


@pytest.mark.parametrize(
    ("method", "limits", "requirement"),
    [
        ("shifted_rss", {"variation": 12.0}, {}),
        ("worst_case", {"variation": 14.0}, {}),
        ("rss", {"yield_percent": 99.73}, {"upper": 11.0}),
        ("rss", {"yield_percent": 99.73}, {"lower": -10.0, "upper": 11.5}),
        ("rss", {"variation": 7.0, "worst_case": 9.0}, {}),
        ("monte_carlo", {"variation": 12.0}, {}),
    ],
)
def test_off_centre_machines_are_proven_by_cells(
    method: str, limits: dict[str, Any], requirement: dict[str, Any]
) -> None:
    given = off_centre(method, limits, **requirement)
    given["part"] = given["part"][: 2 if len(limits) > 1 else 3]
    problem = stack(given)
    cost, bound, _, _ = solved(problem)
    assert bound <= cost <= bound * 1.002
    rng = np.random.default_rng(1)
    x = rng.uniform(problem.xl, problem.xu, (20_000, problem.n_var))
    designs = problem.complete(x)
    values = problem.outputs_of(designs, searching=True)
    kept = np.all(problem.violations(designs, values) <= 0.0, axis=1)
    assert np.sum(kept) > 10 and np.min(values["cost"][kept]) >= bound


@pytest.mark.parametrize("p", [0.6, 0.9, 0.9973, 0.999999])
def test_two_limits_about_a_moving_mean_lie_below_their_tangents(p: float) -> None:
    """Normal deviations that keep -1 and 1 with the probability p, by bisection at 500 means."""
    mean = np.linspace(0.0, 0.98, 500)
    low, high = np.zeros(500), np.full(500, 10.0)
    for _ in range(60):
        std = 0.5 * (low + high)
        kept = norm.cdf((1.0 - mean) / std) - norm.cdf((-1.0 - mean) / std) >= p
        low, high = np.where(kept, std, low), np.where(kept, high, std)
    lines = [(1.0 - mean) / norm.ppf(p), 0.0 * mean + 1.0 / norm.ppf(0.5 * (1.0 + p))]
    found = tangents(p)
    assert len(found) == 4 or p < 0.7
    lines += [(room - mean) / z for z, room in found]
    least = np.min(lines, axis=0)
    assert np.all(least >= low * (1.0 - 1e-9))
    if p >= 0.99:
        assert np.all(least <= low * (1.0018 if p < 0.9973 else 1.0014))


def test_yield_of_machines_without_inspection_is_that_of_a_sample() -> None:
    given = off_centre("rss", {"variation": 30.0}, lower=-8.0, upper=6.0)
    for part in given["part"]:
        part["machine"] = [{k: v for k, v in one.items() if k in ("name", "sigma", "mean", "price")}
                           for one in part["machine"]]  # fmt: skip
    problem = stack(given)
    design = problem.complete(np.array([[0.0] * problem.n_var]))
    found = problem.outputs_of(design)["yield_percent"][0]
    rng, y = np.random.default_rng(5), np.zeros(1_000_000)
    for part, slope in enumerate(SLOPES[:3]):
        one = given["part"][part]["machine"][0]
        y += slope * rng.normal(one["mean"], one["sigma"], len(y))
    share = np.mean((y >= -8.0) & (y <= 6.0))
    np.testing.assert_allclose(found, 100.0 * share, atol=4.0 * 0.05)


def test_formula_sees_the_mean_and_scatter_of_machines() -> None:
    given = off_centre("monte_carlo", {"variation": 30.0}, formula="sqrt(p0**2 + p1**2) - p2",
                       lower=-2.0, upper=26.0)  # fmt: skip
    for part in given["part"]:
        del part["sensitivity"]
        part["nominal"] = 50.0
    del given["requirement"]["nominal"]
    problem = stack(given)
    design = problem.complete(np.array([[0.0] * problem.n_var]))
    found = problem.outputs_of(design)
    rng = np.random.default_rng(5)
    p = [50.0 + rng.normal(one["machine"][0]["mean"], one["machine"][0]["sigma"], 1_000_000)
         for one in given["part"]]  # fmt: skip
    y = np.hypot(p[0], p[1]) - p[2]
    share = 100.0 * np.mean((y >= -2.0) & (y <= 26.0))
    np.testing.assert_allclose(found["yield_percent"][0], share, atol=0.15)
    ends = np.quantile(y, [0.00135, 0.99865])
    np.testing.assert_allclose(found["variation"][0], 0.5 * (ends[1] - ends[0]), rtol=0.02)


def test_derivatives_by_limits_of_inspection() -> None:
    given = off_centre("shifted_rss", {"yield_percent": 90.0}, lower=-12.0, upper=11.0)
    problem = stack(given)
    rng = np.random.default_rng(2)
    designs = problem.complete(rng.uniform(problem.xl, problem.xu, (6, problem.n_var)))
    for part in range(3):
        designs[:, problem.names.index(f"p{part}_process")] = 1
        designs[:, problem.names.index(f"p{part}_t")] = rng.uniform(4.0, 9.0, 6)
    slopes = problem.gradient(designs)
    for part in range(3):
        at, step = problem.names.index(f"p{part}_t"), 1e-4
        up, down = designs.copy(), designs.copy()
        up[:, at] += step
        down[:, at] -= step
        ends = problem.outputs_of(up), problem.outputs_of(down)
        for name in ("cost", "variation", "rss", "yield_percent"):
            slope = (ends[0][name] - ends[1][name]) / (2.0 * step)
            np.testing.assert_allclose(slopes[name][:, at], slope, rtol=1e-4, atol=1e-6)


def test_machines_stand_beside_processes_and_are_written_as_they_are_read() -> None:
    given = table(15.0)
    cost = {"model": "reciprocal", "a": 0.5, "b": 9.0}
    given["part"][0]["process"] = [{"name": "turned", "t_min": 4.0, "t_max": 12.0, "cost": cost}]
    given["part"][1]["machine"][2] |= {
        "mean": "0.2 um", "setup": {"price": 60.0, "lot": 40},
        "inspection": {"price": 0.2, "u": "0.1 um", "scrap": False, "required": True,
                       "rework": {"price": 0.5, "success": 0.8, "side": "both"}}}  # fmt: skip
    problem = stack(given)
    first, second = problem.definition.parts[:2]
    assert [one.name for one in first.processes][:3] == ["turned", "m0", "m0, inspected"]
    assert [one.name for one in second.processes][-1] == "m2, inspected"
    assert len(second.processes) == 5
    machine_ = second.processes[-1].machine
    assert machine_ is not None and machine_.price == pytest.approx(6.5 * 1.13 + 1.5)
    again = stack(given | tables_of(problem.definition))
    assert again.definition.parts == problem.definition.parts
    assert solved(again)[0] == solved(problem)[0]


def test_every_fault_of_machines_is_named_with_its_place() -> None:
    given = table(15.0)
    machines = given["part"][0]["machine"]
    machines[0]["sigma"] = 0.0
    machines[1] |= {"sigma": -1.0, "inspection": {"price": -1.0, "u": "2 mrad", "gard": 1.0}}
    machines[2] = {"name": "m1", "t_min": 1.0, "cost": {"model": "reciprocal"}}
    given["part"][1]["machine"][0]["inspection"] = {"price": 0.3, "u": 4.0}
    given["part"][1]["machine"][1]["inspection"] = {
        "price": 0.3, "rework": {"price": 1.0, "success": 0.0, "side": "top"}}  # fmt: skip
    given["part"][1]["machine"][2] |= {"mean": 60.0}
    given["part"][2] |= {"distribution": "uniform"}
    given["part"][3] |= {"tolerance": 3.0}
    given["part"][4]["machine"][0] |= {"setup": {"price": 3.0, "lot": 0}}
    with pytest.raises(InputError) as caught:
        stack(given)
    places = {fault.place: fault.message for fault in caught.value.faults}
    for place in ("[0].machine[0].sigma", "[0].machine[1].sigma", "[0].machine[1].inspection.price",
                  "[0].machine[1].inspection.u", "[0].machine[1].inspection.gard",
                  "[0].machine[2].name", "[0].machine[2].sigma", "[0].machine[2].price",
                  "[0].machine[2].cost", "[0].machine[2].t_min", "[1].machine[0].t_min",
                  "[1].machine[1].inspection.rework.success",
                  "[1].machine[1].inspection.rework.side", "[1].machine[2].mean",
                  "[2].distribution", "[3]", "[4].machine[0].setup.lot"):  # fmt: skip
        assert f"part{place}" in places, (place, places)
    assert "must be above 0" in places["part[0].machine[0].sigma"]


def test_a_run_with_machines_writes_its_page(tmp_path: Path) -> None:
    """What a machine's parts cost is no function of the tolerance alone: the page computes none."""
    config = written(tmp_path / "c.toml", tomli_w.dumps(table(15.0)))
    arguments = ["run", str(config), "--out", str(tmp_path / "o"), "--quiet"]
    output_of(*arguments, "--set", 'algorithm.name="exact"')
    drawn = json.loads((tmp_path / "o" / "tolerances.json").read_text(encoding="utf-8"))
    assert [one["costs"] for one in drawn if one["name"].endswith("_t")] == [[]] * 5
