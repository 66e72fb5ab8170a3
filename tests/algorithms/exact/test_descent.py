"""Descents on the units that decide: optima with kinks, and results that do not hang on the last digit."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from tolevo.algorithms.exact.descent import GAIN, LATTICE, Descents, Point, descended
from tolevo.algorithms.exact.epsilon import feasible_afresh, scale_of
from tolevo.algorithms.exact.local import Branch
from tolevo.algorithms.exact.multistart import MultiStart
from tolevo.algorithms.exact.solver import Exact
from tolevo.algorithms.run import Run
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget
from tolevo.problems.rv_reducer import RvReducer
from tolevo.problems.rv_reducer.evaluation import Evaluation
from tolevo.problems.settings import Bound, Settings, VariableSetting

Array = NDArray[np.float64]
LAST_DIGITS = 1e-12


class Kinked:
    """A branch whose limit is the largest of planes `rise` (k, n) @ y - `at` (k,), with noise in its last digits."""

    unit = np.ones(1)

    def __init__(self, rise: Array, at: Array, noise: float) -> None:
        self.rise, self.at, self.smooth = rise, at, self
        self.rng, self.noise = np.random.default_rng(5), noise

    def perturbed(self, value: Array) -> Array:
        return value * (1.0 + self.noise * self.rng.standard_normal(np.shape(value)))

    def values(self, y: Array) -> tuple[Array, Array]:
        return self.perturbed(np.exp(-2.0 * y).sum(keepdims=True)), self.perturbed(
            (self.rise @ y - self.at).max(keepdims=True)
        )

    def slopes(self, y: Array) -> tuple[Array, Array]:
        active = int(np.argmax(self.perturbed(self.rise @ y - self.at)))
        return self.perturbed(-2.0 * np.exp(-2.0 * y)[None, :]), self.perturbed(self.rise[[active]])


def least_of_planes(rise: Array, at: Array) -> float:
    """The least sum of exp(-2 y) with all planes as limits of their own."""
    minimize: Any = scipy.optimize.minimize
    planes = scipy.optimize.LinearConstraint(rise, -np.inf, at)
    start = np.full(rise.shape[1], 0.05)
    box = scipy.optimize.Bounds(0.0, 1.0)
    return float(minimize(lambda y: np.exp(-2.0 * y).sum(), start, bounds=box, constraints=[planes], tol=1e-10).fun)


@pytest.mark.parametrize("start", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("seed", range(3))
def test_ends_at_optimum_with_kinks_whatever_the_last_digits(seed: int, start: float) -> None:
    rng = np.random.default_rng(seed)
    rise = rng.uniform(0.1, 1.0, (12, 6))
    at = rng.uniform(0.9, 1.1, 12)
    exact, rounded = (descended(Kinked(rise, at, noise), np.full(6, start)) for noise in (0.0, LAST_DIGITS))  # type: ignore[arg-type]
    assert np.array_equal(exact.y, rounded.y)
    np.testing.assert_allclose(exact.y / LATTICE, np.rint(exact.y / LATTICE), atol=1e-9)
    assert np.all(rise @ exact.y <= at)
    assert exact.f == pytest.approx(least_of_planes(rise, at), rel=2e-3)


def test_a_descent_that_may_not_go_on_ends_at_its_best_point() -> None:
    rng = np.random.default_rng(0)
    rise, at, left = rng.uniform(0.1, 1.0, (12, 6)), rng.uniform(0.9, 1.1, 12), iter([True] * 4)
    ends = [
        descended(Kinked(rise, at, 0.0), np.full(6, 0.5), go)  # type: ignore[arg-type]
        for go in (lambda: False, lambda: next(left, False), lambda: True)
    ]
    np.testing.assert_array_equal(ends[0].y, np.full(6, 0.5))
    assert ends[1].improves(ends[0])
    assert ends[2].improves(ends[1])


def test_a_point_that_keeps_the_limits_improves_on_any_that_does_not() -> None:
    def point(f: float, violation: float) -> Point:
        return Point(np.zeros(1), f, np.array([violation]), np.zeros(1), np.zeros((1, 1)))

    assert point(2.0, 0.0).improves(point(1.0, 0.5 * GAIN))
    assert not point(1.0, 0.4 * GAIN).improves(point(1.0, 0.5 * GAIN))
    assert point(-1.1, 0.0).improves(point(-1.0, 0.0))
    assert not point(-1.0, 0.0).improves(point(-1.0, 0.0))


def reducer(limit: float, grade: VariableSetting, positions: int = 13) -> RvReducer:
    """The least cost of a reducer on so few units that one of them is the quantile."""
    sizes = {"search_units": 32, "report_units": 64, "elastic_units": 32, "positions": positions, "te_positions": 61}
    variables = {
        "involute_grade": grade,
        "dr_rp_mm": VariableSetting(low=-0.06, high=-0.02),
        "dr_p_mm": VariableSetting(low=-0.09, high=-0.05),
    }
    limits = {"interference_probability": Bound(high=0.05), "backlash_max_arcmin": Bound(high=limit)}
    return RvReducer(Settings(sizes, variables, objectives=("cost",), limits=limits, seed=1))


def least_cost(problem: RvReducer, seed: int, patch: pytest.MonkeyPatch) -> float:
    """The cost that `exact` ends at, with statistics that differ in their last digits by a `seed`, 0: as they are."""
    value, gradient = Evaluation.value, Evaluation.gradient

    def factor(of: Evaluation, name: str) -> float:
        key = repr((seed, name, of.drawn.sizes, sorted(of.design.half_width.items()), of.involute.middle)).encode()
        drawn = int.from_bytes(hashlib.blake2b(key, digest_size=4).digest(), "big") / 2.0**31
        return 1.0 + (LAST_DIGITS * (drawn - 1.0) if seed else 0.0)

    def slopes(of: Evaluation, name: str) -> dict[str, float]:
        return {variable: slope * factor(of, name + variable) for variable, slope in gradient(of, name).items()}

    with patch.context() as perturbed:
        perturbed.setattr(Evaluation, "value", lambda of, name: value(of, name) * factor(of, name))
        perturbed.setattr(Evaluation, "gradient", slopes)
        found = search(problem, Exact(), Budget(), 1).chosen
    f, g = problem.tested(found)
    assert np.any(np.all(g <= 0.0, axis=1)), "a design that keeps the limits exists, and none was found"
    return float(f[np.all(g <= 0.0, axis=1), 0].min())


ANY_GRADE = VariableSetting()


@pytest.mark.parametrize(
    ("limit", "before", "grade"),
    [
        pytest.param(0.8, 30.43, VariableSetting(value=4.0), id="0.8, grade 4"),
        pytest.param(0.8, 23.49, ANY_GRADE, id="0.8", marks=pytest.mark.slow),
        pytest.param(1.0, 14.07, ANY_GRADE, id="1.0", marks=pytest.mark.slow),
        pytest.param(1.2, 12.90, ANY_GRADE, id="1.2", marks=pytest.mark.slow),
    ],
)
def test_least_cost_on_few_units_does_not_hang_on_the_last_digit(
    limit: float, before: float, grade: VariableSetting, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without descents, the least that some of these perturbations led to was `before`."""
    costs = [least_cost(reducer(limit, grade), seed, monkeypatch) for seed in range(2)]
    np.testing.assert_allclose(costs, costs[0], rtol=5e-3)
    assert max(costs) <= 1.005 * before


def least_of_descents(run: Run) -> list[Array | None]:
    """What descents of a run lead to in two sets of integers, asked twice."""
    sets = [np.where([v.integer for v in run.problem.free], grade, run.problem.xl) for grade in (4.0, 5.0)]
    descents = Descents.of(run)
    assert descents is not None
    return [descents.cheapest(sets, np.ones(1)) for _ in range(2)]


def test_descents_are_done_once_and_within_the_time_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    begun, phases = [], set()

    def stub(branch: Any, start: Array, goes_on: Any) -> Point:
        begun.append(start)
        goes_on()
        return Point(start, float(len(begun)), np.zeros(1), start, start)

    monkeypatch.setattr("tolevo.algorithms.exact.descent.descended", stub)
    problem = reducer(1.2, ANY_GRADE)
    monkeypatch.setattr(problem, "tested", lambda x: (np.zeros((1, 1)), np.zeros((1, 2))))
    spent = Run(problem, Budget(time_limit_s=0.0), 1)
    assert least_of_descents(spent) == [None, None]
    assert not begun
    first, again = least_of_descents(Run(problem, Budget(), 1, lambda progress: phases.add(progress.phase)))
    assert first is not None
    np.testing.assert_array_equal(first, again)
    assert 2 < len(begun) <= 5  # of both sets, and the other starts of the cheaper one
    assert phases == {"descents on fresh units"}
    assert (
        Descents.of(Run(RvReducer(replace(problem.given, objectives=("cost", "backlash_max_arcmin"))), Budget(), 1))
        is None
    )


@pytest.mark.parametrize(("solver", "descends"), [(MultiStart(starts=1), False), (Exact(), True)])
def test_exact_alone_descends(solver: Any, descends: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(Descents, "cheapest", lambda *given: asked.append(given))
    assert len(search(reducer(1.2, VariableSetting(value=4.0), 5), solver, Budget(), 1).chosen) == 1
    assert bool(asked) == descends


class OneDescent:
    """Descents that lead to a search vector, among few units or many."""

    def __init__(self, few_units: bool, x: Array) -> None:
        self.few_units, self.x, self.asked = few_units, x, 0

    def cheapest(self, sets: list[Array], unit: Array) -> Array:
        self.asked += 1
        return self.x


def test_accepted_ends_are_compared_with_descents_on_few_units() -> None:
    problem = reducer(3.0, VariableSetting(value=4.0), 5)
    run = Run(problem, Budget(), 1)
    branch, none = Branch(run, problem.xl, scale_of(problem)), np.full(1, np.inf)
    y = branch.solved(0, branch.starts(run)[0], none, np.zeros(1))

    def end(descents: Any) -> Array:
        return feasible_afresh(run, branch, y, none, search=True, descents=descents)

    accepted = end(None)
    near = np.maximum(problem.xl, accepted * np.where(accepted > 0.0, 1.0 - 1e-5, 1.0))
    (least, dearer), kept = (problem.tested(np.vstack([x, problem.xl]))[i] for x, i in ((near, 0), (near, 1)))
    assert np.all(kept[0] <= 0.0)
    assert least < 1.003 * problem.tested(accepted)[0].item() < dearer
    for few, given, taken in ((False, near, accepted), (True, near, near), (True, problem.xl[None, :], accepted)):
        descents = OneDescent(few, given)
        np.testing.assert_array_equal(end(descents), taken)
        assert descents.asked == few


def test_searches_on_fresh_units_see_what_is_reported() -> None:
    problem = reducer(1.0, ANY_GRADE)
    x = np.stack([problem.xl + fraction * (problem.xu - problem.xl) for fraction in (0.2, 0.6)])
    searched, fresh = problem.searched(x), problem.on_fresh_units()
    for seen, reported, other in zip(fresh.searched(x), problem.tested(x), searched, strict=True):
        np.testing.assert_array_equal(seen, reported)
        assert np.any(seen[:, -1:] != other[:, -1:]) or np.array_equal(reported[:, 0], other[:, 0])
    for again, once in zip(problem.searched(x), searched, strict=True):
        np.testing.assert_array_equal(again, once)
