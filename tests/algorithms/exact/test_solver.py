"""`exact` through `search` on stacks, against Lagrange by hand and against scipy's SLSQP."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import optimize

from tolevo.algorithms.exact.bounds import proof
from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.search import SearchResult, search
from tolevo.algorithms.settings import Budget
from tolevo.configuration.reader import read_table
from tolevo.errors import Fault
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import Bound, PropagationSetting, Settings
from tolevo.problems.stack import Stack
from tolevo.problems.tolerance_problem import ToleranceProblem
from tolevo.section import Section

Array = NDArray[np.float64]
minimize: Any = optimize.minimize  # its stubs know arrays of one fixed dimension only
S = np.array([1.0, -2.0, 0.5, 1.0])
A = np.array([2.0, 1.5, 1.0, 0.5])
B = np.array([0.04, 0.09, 0.01, 0.16])
LOW, HIGH = 0.01, 0.4


def part(at: int, more: str = "", low: float = LOW, cost: str = "") -> str:
    cost = cost or f'{{ model = "reciprocal", a = {A[at]}, b = {B[at]} }}'
    return (f'[[part]]\nname = "p{at}"\nsensitivity = {S[at]}\nt_min = {low}\nt_max = {HIGH}\n'
            f"cost = {cost}\n{more}\n")  # fmt: skip


def stack(
    method: str = "rss",
    more: tuple[str, str, str, str] = ("", "", "", ""),
    after: str = "",
    parts: str = "",
    **settings: Any,
) -> Stack:
    text = f'[requirement]\nunit = "mm"\nmethod = "{method}"\n'
    text += parts or "".join(part(at, more[at]) for at in range(4))
    faults: list[Fault] = []
    made = Stack.configured(Section(tomllib.loads(text + after), "", faults))
    assert not faults
    assert made is not None
    return Stack(Settings(definition=made.read["definition"], **settings))


SHIFTED = ("shift = 0.2", "", "cpk = 0.8", "cp = 1.5")
CORRELATED = '[[correlation]]\nparts = ["p0", "p1"]\ncoefficient = {}\n'


def shifted(t: Array) -> float:
    cp, shift = np.array([1.0, 1.0, 1.0, 1.5]), np.array([0.2, 0.0, 0.2, 0.0])
    return float(np.abs(S) * shift @ t + np.linalg.norm(S * t / cp))


def correlated(t: Array, coefficient: float) -> float:
    s = S * t
    return float(np.sqrt(np.sum(s * s) + 2.0 * coefficient * s[0] * s[1]))


CASES: dict[str, tuple[dict[str, Any], Any]] = {
    "worst_case": ({"method": "worst_case"}, lambda t: float(np.abs(S) @ t)),
    "rss": ({}, lambda t: float(np.linalg.norm(S * t))),
    "shifted_rss": ({"method": "shifted_rss", "more": SHIFTED}, shifted),
    "correlated": ({"after": CORRELATED.format(-0.7)}, lambda t: correlated(t, -0.7)),
    "compensating": ({"after": CORRELATED.format(0.95)}, lambda t: correlated(t, 0.95)),
}


def by_slsqp(variation: Any, limit: float, more: Any = None, low: float = LOW) -> float:
    """Least cost of the four parts by multi-start SLSQP in ln t."""
    best, rng = np.inf, np.random.default_rng(0)
    margins: list[Any] = [lambda x: limit - variation(np.exp(x))]
    if more is not None:
        margins.append(lambda x: more(np.exp(x)))
    for _ in range(8):
        found = minimize(
            lambda x: float(np.sum(A + B / np.exp(x))),
            np.log(rng.uniform(low, HIGH, 4)),
            bounds=[(np.log(low), np.log(HIGH))] * 4,
            constraints=[{"type": "ineq", "fun": margin} for margin in margins],
            method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 500},
        )
        if all(margin(found.x) >= -1e-9 for margin in margins):
            best = min(best, float(found.fun))
    return best


def run(problem: ToleranceProblem, points: int = 60) -> SearchResult:
    found = search(problem, Exact(points=points), Budget(), seed=0)
    assert np.all(found.x >= problem.xl) and np.all(found.x <= problem.xu)
    out = problem.evaluate(found.x, return_as_dictionary=True)
    np.testing.assert_array_equal(out["F"], found.f)
    assert problem.n_ieq_constr == 0 or np.all(out["G"] <= 0.0)
    return found


def gaps(problem: ToleranceProblem, f: Array) -> Array:
    values = dict(zip(problem.objectives, f.T, strict=True))
    return proof(problem, values, len(f)).gap_percent(values["cost"])


@pytest.mark.parametrize("case", CASES)
def test_front_is_that_of_another_solver(case: str) -> None:
    settings, variation = CASES[case]
    problem = stack(**settings)
    found = run(problem)
    assert len(found.x) >= 55
    np.testing.assert_allclose(found.f[:, 1], [variation(t) for t in found.x], rtol=1e-12)
    for cost, limit in found.f[:: len(found.f) // 5]:
        assert cost == pytest.approx(by_slsqp(variation, limit), rel=2e-6)
    assert np.all(gaps(problem, found.f) < 1e-4)


@pytest.mark.parametrize("case", CASES)
def test_no_design_is_cheaper_than_its_bound(case: str) -> None:
    settings, _ = CASES[case]
    problem = stack(**settings)
    rng = np.random.default_rng(1)
    x = np.exp(rng.uniform(np.log(LOW), np.log(HIGH), size=(80, 4)))
    f = problem.evaluate(x)
    values = dict(zip(problem.objectives, f.T, strict=True))
    bound = proof(problem, values, len(f)).bound
    assert np.all(np.isfinite(bound)) and np.all(bound <= f[:, 0])


def test_1000_points_reach_99_95_percent_of_the_hypervolume() -> None:
    problem = stack()
    found = search(problem, Exact(points=1000), Budget(), seed=0)
    prices = np.geomspace(1e-6, 1e8, 40_000)[:, None]
    t = np.clip((B / (2.0 * prices * S**2)) ** (1.0 / 3.0), LOW, HIGH)
    front = np.stack([np.sum(A + B / t, axis=1), np.linalg.norm(S * t, axis=1)], axis=1)
    ideal, nadir = problem.box()
    cost, variation = ((front - ideal) / (nadir - ideal)).T
    heights = 1.1 - 0.5 * (variation[1:] + variation[:-1])
    whole = float(np.sum(np.diff(cost) * heights) + (1.1 - cost[-1]) * (1.1 - variation[-1]))
    assert 0.9995 * whole <= found.history[-1].hypervolume <= whole * (1.0 + 1e-7)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("share", [0.05, 0.3])
def test_one_optimum_within_a_limit(case: str, share: float) -> None:
    settings, variation = CASES[case]
    ends = [variation(np.full(4, end)) for end in (LOW, HIGH)]
    limit = ends[0] + share * (ends[1] - ends[0])
    bounds = {"variation": Bound(high=limit)}
    found = run(stack(**settings, objectives=("cost",), limits=bounds))
    assert found.f.min() == pytest.approx(by_slsqp(variation, limit), rel=1e-6)


def test_another_limit_is_kept_along_the_whole_front() -> None:
    limits = {"worst_case": Bound(high=0.4), "cost": Bound(high=30.0), "p1_t": Bound(high=0.06)}
    problem = stack(limits=limits)
    found = run(problem, points=24)
    assert np.all(gaps(problem, found.f) < 1e-4)
    rss = CASES["rss"][1]

    def others(t: Array) -> float:
        return float(min(0.4 - np.abs(S) @ t, 0.06 - t[1]))

    for cost, limit in found.f[:: len(found.f) // 4]:
        assert cost == pytest.approx(by_slsqp(rss, limit, others), rel=2e-6)


def test_limit_that_is_the_tightest_corner_is_met() -> None:
    for method, limit in (("worst_case", 0.045), ("rss", float(np.linalg.norm(S * LOW)))):
        limits = {"variation": Bound(high=limit)}
        found = run(stack(method, objectives=("cost",), limits=limits))
        np.testing.assert_allclose(found.f, [[np.sum(A + B / LOW)]], rtol=1e-9)


def test_compensating_deviations_are_no_tighter_at_the_tightest_corner() -> None:
    """p0 is wide at least and p1 follows it: the corner has twice the least variation."""
    wide = part(0, low=0.1) + part(1, low=0.01)
    settings: dict[str, Any] = {"parts": wide, "after": CORRELATED.format(0.95)}

    def variation(t: Array) -> float:
        s = S[:2] * t
        return float(np.sqrt(s @ s + 1.9 * s[0] * s[1]))

    corner = variation(np.array([0.1, 0.01]))
    limits = {"variation": Bound(high=0.5 * corner)}
    problem = stack(**settings, objectives=("cost",), limits=limits)
    found = run(problem)
    t0, t1 = np.meshgrid(np.linspace(0.1, 0.4, 1201), np.linspace(0.01, 0.4, 1561))
    v = np.sqrt(t0**2 + 4.0 * t1**2 - 3.8 * t0 * t1)
    grid = np.where(v <= 0.5 * corner, A[0] + B[0] / t0 + A[1] + B[1] / t1, np.inf)
    assert found.f.min() == pytest.approx(grid.min(), rel=2e-3)
    assert found.f.min() <= grid.min()
    assert gaps(problem, found.f)[0] < 1e-4
    limits = {"variation": Bound(high=0.3 * 0.1 * np.sqrt(1.0 - 0.95**2))}
    assert not len(run(stack(**settings, objectives=("cost",), limits=limits)).x)


def test_costs_below_zero_are_bounded_too() -> None:
    costs = [f'{{ model = "reciprocal", a = {-5.0 - a}, b = {b} }}' for a, b in zip(A, B, strict=True)]
    problem = stack(parts="".join(part(at, cost=cost) for at, cost in enumerate(costs)))
    found = run(problem)
    assert found.f[:, 0].min() < -20.0
    assert np.all(np.nan_to_num(gaps(problem, found.f)) < 1e-4)


@pytest.mark.parametrize("limit", [0.5, 0.8, 0.95])
def test_a_flat_cost_buys_nothing(limit: float) -> None:
    flat = part(0) + part(1, cost='{ model = "reciprocal", a = 1.0, b = 0.0 }')
    bounds = {"variation": Bound(high=limit)}
    problem = stack(parts=flat, objectives=("cost",), limits=bounds)
    found = run(problem)
    np.testing.assert_allclose(found.f, [[A[0] + B[0] / HIGH + 1.0]], rtol=1e-9)
    assert gaps(problem, found.f)[0] < 1e-4


def test_tables_that_are_not_convex_are_searched_piece_by_piece() -> None:
    table = '{ model = "table", t = [0.01, 0.05, 0.06, 0.4], cost_at = [9.0, 8.9, 3.0, 2.9] }'
    parts = part(0, cost=table) + part(3, cost=table) + part(2)
    knots, costs = [0.01, 0.05, 0.06, 0.4], [9.0, 8.9, 3.0, 2.9]
    a, c = np.meshgrid(np.linspace(0.01, 0.08, 351), np.linspace(0.01, 0.08, 351))
    for limit in (0.07, 0.08, 0.1):
        bounds = {"variation": Bound(high=limit)}
        problem = stack(parts=parts, objectives=("cost",), limits=bounds)
        found = run(problem)
        room = np.sqrt(np.maximum(limit**2 - a**2 - c**2, 0.0)) / 0.5
        last = np.clip(room, LOW, HIGH)
        total = np.interp(a, knots, costs) + np.interp(c, knots, costs) + A[2] + B[2] / last
        grid = np.where(room >= LOW, total, np.inf).min()
        assert found.f.min() <= grid * (1.0 + 1e-8)  # a limit is kept to its last digit
        assert found.f.min() == pytest.approx(grid, rel=5e-3)
        assert gaps(problem, found.f)[0] < 1e-4


def test_backlash_by_moments_is_within_its_bound() -> None:
    settings = Settings(
        propagation=PropagationSetting(method="moments"), objectives=("cost", "backlash_geometric_arcmin")
    )
    problem = RvBacklash(settings)
    found = run(problem, 20)
    assert len(found.f) >= 15
    gap = gaps(problem, found.f)
    assert np.all(gap >= 0.0)
    assert np.median(gap) < 1.0


def test_requirement_that_no_tolerance_changes() -> None:
    """Two pieces of one part that compensate each other wholly."""
    both = '[[correlation]]\nparts = ["p0_1", "p0_2"]\ncoefficient = -1.0\n'
    problem = stack(parts=part(0, "count = 2"), after=both)
    found = run(problem)
    assert len(found.f)
    np.testing.assert_allclose(found.f[:, 0], 2.0 * (A[0] + B[0] / HIGH))
    np.testing.assert_allclose(found.f[:, 1], 0.0, atol=1e-12)


@pytest.mark.parametrize("objectives", [["cost"], ["cost", "size.variation"]])
def test_limits_missed_by_the_rounding_of_the_outputs_are_asked_again(objectives: list[str]) -> None:
    """The yield of one part: its convolution is 8e-5 percent points below the form's integral.

    It binds at the least cost, and all along the front of the other requirement.
    """
    edge = 0.18695858496654041
    curves = [{"model": "reciprocal", "a": a, "b": b} for a, b in ((2.0, 0.032), (1.0, 0.017))]
    table = {
        "problem": "stack", "algorithm": {"name": "exact"},
        "objectives": {"minimise": objectives}, "limits": {"gap": {"yield_percent": 99.73}},
        "requirement": [
            {"name": "size", "unit": "mm"},
            {"name": "gap", "unit": "mm", "nominal": 0.0, "lower": -edge, "upper": edge},
        ],
        "part": [
            {"name": "p0", "sensitivity": {"size": -0.957}, "t_min": 0.01, "t_max": 0.3,
             "cost": curves[0]},
            {"name": "p1", "sensitivity": {"gap": 0.6731883630152654}, "t_min": 0.01, "t_max": 0.3,
             "distribution": "truncated_normal", "cost": curves[1]},
        ],
    }  # fmt: skip
    problem = read_table(table, []).problem
    assert problem is not None
    found = search(problem, Exact(points=20), Budget(), 1)
    assert len(found.x) == (1 if len(objectives) == 1 else 20)
    if len(objectives) == 1:
        gap = proof(problem, {"cost": found.f[:, 0]}, 1).gap_percent(found.f[:, 0])
        assert 0.0 <= gap[0] < 1e-3
