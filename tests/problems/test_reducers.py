"""The front of a nested reducer: the closed form of E b^2, its least costs and their bounds."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import optimize
from scipy.integrate import quad
from scipy.stats import norm

from tolevo.configuration.reader import read_table
from tolevo.models.rv_reducer.geometry import mean_square
from tolevo.problems.nested_reducers import (
    PRICES,
    Block,
    Clipped,
    ReducerFront,
    block_of,
    curve_of_points,
    documents_reducer,
    least_cost_allocations,
    lower_bound,
)
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import Bound, Settings, VariableSetting

minimize: Any = optimize.minimize  # its stubs know arrays of one fixed dimension only


@pytest.fixture(scope="module")
def block() -> Block:
    found = documents_reducer().block
    assert found is not None
    return found


@pytest.fixture(scope="module")
def front(block: Block) -> ReducerFront:
    return ReducerFront.of(block)


@pytest.fixture(scope="module")
def limited() -> Block:
    """Modification and stagger free, interference at most 5 %."""
    found = block_of(RvBacklash(Settings(limits={"interference_probability": Bound(high=0.05)})))
    assert isinstance(found, Block)
    return found


@pytest.mark.parametrize(("a", "w", "m", "v"), [(0.5, 0.02, 0.1, 0.3), (0.3, 0.0, -0.8, 0.2)])
def test_closed_form_is_the_integral(a: float, w: float, m: float, v: float) -> None:
    deviation = np.sqrt(v)

    def part(order: int) -> float:
        ends = m - 12.0 * deviation, m + 12.0 * deviation
        return float(quad(lambda x: max(0.0, x) ** order * norm.pdf(x, m, deviation), *ends,
                          points=[0.0], epsabs=1e-13)[0])  # fmt: skip

    found = mean_square(*(np.array([one]) for one in (a, w, m, v)))
    assert found.value[0] == pytest.approx(a**2 + w + 2 * a * part(1) + part(2), rel=1e-9)
    step = 1e-6
    for at, slope in ((2, found.by_mean), (3, found.by_variance), (0, found.by_free)):
        ends = []
        for sign in (1.0, -1.0):
            given = [a, w, m, v]
            given[at] += sign * step
            ends.append(mean_square(*(np.array([one]) for one in given)).value[0])
        assert slope[0] == pytest.approx((ends[0] - ends[1]) / (2.0 * step), rel=1e-6)


def test_closed_form_against_the_convolution_of_uniform_errors(block: Block) -> None:
    """The note: median 0.3 %, worst 1.3 % of 300 designs."""
    problem = block.problem
    x = np.random.default_rng(2).uniform(problem.xl, problem.xu, size=(300, problem.n_var))
    designs = problem.complete(x)
    exact = problem.outputs_of(designs, searching=True)["backlash_rms_arcmin"]
    off = np.abs(np.sqrt(block.of_designs(designs)) / exact - 1.0)
    assert np.median(off) < 0.004
    assert off.max() < 0.015


def test_documents_reducer_has_the_rms_of_the_note() -> None:
    problem = documents_reducer().problem
    assert problem is not None
    design = problem.references()["document B"][None, :]
    assert problem.outputs_of(design)["backlash_rms_arcmin"][0] == pytest.approx(0.742, abs=5e-4)


class TestLeastCost:
    def test_against_slsqp_in_all_tolerances(self, block: Block) -> None:
        """The same minimum by another way: SLSQP in ln t with differences."""
        kappa, grade = 30.0, 1
        ends = list(zip(np.log(block.low), np.log(block.high), strict=True))

        def objective(y: np.ndarray) -> float:
            t, place = np.exp(y)[None, :], np.array([grade])
            s = np.array([block.shift.low])
            cost = block.cost(t[:, :-1], t[:, -1], place)
            return float(cost[0] + kappa * block.backlash(t[:, :-1], t[:, -1], place, s).value[0])

        start = 0.5 * (np.log(block.low) + np.log(block.high))
        found = minimize(objective, start, bounds=ends, method="SLSQP",
                                  options={"ftol": 1e-14, "maxiter": 500})  # fmt: skip
        own = least_cost_allocations(block, np.array([kappa]), np.array([grade]))
        assert own.cost[0] + kappa * own.square[0] == pytest.approx(found.fun, rel=1e-9)

    def test_bounds_are_below_random_allocations_and_near_the_best(self, limited: Block) -> None:
        kappa, grade = np.geomspace(0.1, 1e3, 40), np.arange(40) % 5
        own = least_cost_allocations(limited, kappa, grade)
        proven = lower_bound(limited, kappa, grade, own)
        best = own.cost + kappa * own.square
        assert np.all(proven <= best * (1.0 + 1e-12))
        assert np.max(1.0 - proven / best) < 1e-6
        rng = np.random.default_rng(4)
        for _ in range(300):
            t = limited.low * (limited.high / limited.low) ** rng.uniform(size=(40, 10))
            near = rng.uniform(size=(40, 1)) ** 2  # also close to the best
            t = np.exp((1 - near) * np.log(np.column_stack([own.t, own.bearing])) + near * np.log(t))
            s = limited.least_shift(*limited.of_phi_2(t[:, :-1]))
            value = limited.cost(t[:, :-1], t[:, -1], grade)
            value += kappa * limited.backlash(t[:, :-1], t[:, -1], grade, s).value
            assert np.all(value >= proven)

    def test_a_bound_that_does_not_depend_on_the_iteration(self, block: Block) -> None:
        """At an allocation far from the best the bound is lower, and still one."""
        kappa, grade = np.array([30.0]), np.array([1])
        own = least_cost_allocations(block, kappa, grade)
        far = least_cost_allocations(block, np.array([3.0]), grade)
        assert lower_bound(block, kappa, grade, far)[0] < (own.cost + kappa * own.square)[0]

    def test_interference_is_kept(self, limited: Block) -> None:
        kappa, grade = np.geomspace(1.0, 300.0, 8), np.full(8, 1)
        own = least_cost_allocations(limited, kappa, grade)
        designs = limited.designs(own.t, own.bearing, grade, own.s)
        found = limited.problem.outputs_of(designs)
        np.testing.assert_allclose(found["interference_probability"], 0.05, atol=1e-3)
        np.testing.assert_allclose(found["cost"], own.cost, rtol=1e-9)
        np.testing.assert_allclose(limited.of_designs(designs), own.square, rtol=1e-9)


class TestFront:
    def test_curve_is_convex_and_tight(self, front: ReducerFront) -> None:
        assert front.evaluations == 5 * len(PRICES)
        for curve in front.curves:
            assert 0.0 <= curve.margin < 1e-4
            square = np.linspace(curve.t[0] ** 2, curve.t[-1] ** 2, 4000)
            cost = curve.cost(np.sqrt(square))
            assert np.all(np.diff(cost) < 0.0)
            assert np.all(np.diff(cost, 2) > -1e-7)  # the last kinks of a cubic

    def test_allocations_have_what_the_curve_says(self, front: ReducerFront) -> None:
        rms, grade = np.array([0.35, 0.516, 0.627, 1.2]), np.array([0, 1, 1, 3])
        own = front.allocation(rms, grade)
        np.testing.assert_allclose(np.sqrt(own.square), rms, rtol=1e-9)
        for at, place in enumerate(grade):
            curve = front.curves[place]
            assert own.cost[at] - curve.cost(rms[at : at + 1])[0] == pytest.approx(curve.margin, abs=1e-7)

    def test_best_is_the_minimum_and_slope_the_derivative(self, front: ReducerFront) -> None:
        curve = front.curves[1]
        square = np.geomspace(0.5, 500.0, 9)
        t = curve.best(np.zeros(9), square, float(curve.t[0]), float(curve.t[-1]))
        for step in (1.0 - 1e-3, 1.0 + 1e-3):
            other = np.clip(t * step, curve.t[0], curve.t[-1])
            assert np.all(curve.cost(other) + square * other**2
                          >= curve.cost(t) + square * t**2 - 1e-12)  # fmt: skip
        inner = np.linspace(0.4, 1.5, 7)
        slope = (curve.cost(inner + 1e-6) - curve.cost(inner - 1e-6)) / 2e-6
        np.testing.assert_allclose(curve.slope(inner), slope, rtol=1e-6)

    def test_the_wrong_statistic_costs_money(self, front: ReducerFront) -> None:
        """The front of the quantile nests 2 to 5 % dearer reducers of equal E b^2."""
        block = front.block
        grade = np.array([1])
        target = least_cost_allocations(block, np.array([12.0]), grade)
        ends = list(zip(np.log(block.low), np.log(block.high), strict=True))

        def quantile(y: np.ndarray) -> float:
            t = np.exp(y)[None, :]
            mean, variance = block.of_phi_2(t[:, :-1])
            free = block.grade_mean[1] + block.bearing_mean * t[0, -1]
            own = block.grade_variance[1] + block.bearing_variance * t[0, -1] ** 2
            whole = np.sqrt(variance[0] + own)
            return float(free + mean[0] + block.shift.low + norm.ppf(0.9973) * whole)

        def cost(y: np.ndarray) -> float:
            t = np.exp(y)[None, :]
            return float(block.cost(t[:, :-1], t[:, -1], grade)[0])

        def square(y: np.ndarray) -> float:
            t = np.exp(y)[None, :]
            s = np.array([block.shift.low])
            return float(block.backlash(t[:, :-1], t[:, -1], grade, s).value[0])

        def at(level: float) -> Any:
            rule = {"type": "ineq", "fun": lambda y: level - quantile(y)}
            start = np.log(np.column_stack([target.t, target.bearing]))[0]
            return minimize(cost, start, bounds=ends, constraints=[rule], method="SLSQP",
                                     options={"maxiter": 200})  # fmt: skip

        start = np.log(np.column_stack([target.t, target.bearing]))[0]
        ends_ = 0.8 * quantile(start), 1.1 * quantile(start)
        level = optimize.brentq(lambda q: square(at(q).x) - target.square[0], *ends_, xtol=1e-4)
        dearer = cost(at(level).x) / target.cost[0] - 1.0
        assert 0.005 < dearer < 0.06


def test_clipped_errors() -> None:
    """Costs of independent errors in closed form: against SLSQP, and at both ends."""
    own = Clipped(np.array([3.0, 1.0, 0.2]), np.full(3, 2.0), 0.2, 6.0)
    t = 4.0
    found = minimize(
        lambda h: float(np.sum(2.0 / h)), np.full(3, 1.0), bounds=[(0.2, 6.0)] * 3, method="SLSQP",
        constraints=[{"type": "ineq", "fun": lambda h: t**2 - np.sum((own.gain * h) ** 2)}],
        options={"ftol": 1e-15, "maxiter": 500},
    )  # fmt: skip
    assert own.curve.cost(np.array([t]))[0] == pytest.approx(found.fun, rel=1e-5)
    np.testing.assert_allclose(own.allocation(np.array([t]))[0], found.x, rtol=5e-3)
    np.testing.assert_allclose(own.curve.t[[0, -1]], own.ends, rtol=1e-9)


def test_curve_of_points_is_their_lower_hull() -> None:
    rms, cost = (1.0, 0.5, 0.7, 0.8, 2.0), (6.0, 12.0, 8.0, 9.5, 4.0)
    found = curve_of_points(rms, cost)
    np.testing.assert_allclose(found.t, [0.5, 0.7, 1.0, 2.0])
    np.testing.assert_allclose(found.cost(np.array([0.5, 0.7, 2.0, 3.0])), [12.0, 8.0, 4.0, 4.0])
    assert np.isinf(found.cost(np.array([0.4]))[0])
    assert found.priced


def test_errors_of_a_skew_law_are_not_nested() -> None:
    path = Path(__file__).resolve().parents[2] / "configs" / "robot_reducer.toml"
    if not path.is_file():
        pytest.skip("needs the checkout")
    table = tomllib.loads(path.read_text())
    table["variables"]["pin_radius_um"] = {"distribution": "rayleigh"}
    problem = read_table(table, []).problem
    assert isinstance(problem, RvBacklash)
    assert "must be even" in str(block_of(problem))


def test_fixed_tolerances_are_nested_as_they_are() -> None:
    fixed = {name: VariableSetting(value=value)
             for name, value in {"pin_radius_um": 1.0, "involute_grade": 6.0}.items()}  # fmt: skip
    found = block_of(RvBacklash(Settings(variables=fixed)))
    assert isinstance(found, Block)
    own = least_cost_allocations(found, np.array([5.0]), np.array([0]))
    assert own.t[0, found.names.index("pin_radius_um")] == 1.0
    assert list(found.grades) == [6.0]
