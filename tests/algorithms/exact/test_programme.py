"""Several requirements and correlations: another solver, and the bound at random points."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import optimize

from tolevo.algorithms.exact.choices import least_cost
from tolevo.algorithms.exact.combination import Combination, Path
from tolevo.algorithms.exact.programme import Programme
from tolevo.models.costs import ReciprocalPower
from tolevo.problems.forms import Feature, Form, Way

LOW, HIGH = 0.005, 2.0

minimize: Any = optimize.minimize  # its stubs know arrays of one fixed dimension only


def form_of(n: int, rows: int, shift: float = 0.0, correlated: bool = False, seed: int = 0) -> Form:
    rng = np.random.default_rng(seed)

    def way() -> Way:
        curve = ReciprocalPower(rng.uniform(0.0, 3.0), rng.uniform(0.02, 0.3), rng.uniform(0.5, 2.0))
        linear, spread = shift * rng.uniform(0.0, 1.0, rows), rng.normal(size=rows)
        return Way(curve, LOW, HIGH, tuple(linear), tuple(spread))

    features = tuple(Feature(f"t_{at}", (way(),)) for at in range(n))
    factor = rng.normal(size=(n, n))
    covariance = factor @ factor.T
    scale = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(scale, scale) if correlated else None
    names = tuple(f"requirement_{row}" for row in range(rows))
    return Form(names, features, np.zeros(rows), np.zeros(rows), "", correlation=correlation)


def limits_of(form: Form, seed: int = 1, tight: float = 0.9) -> np.ndarray:
    rng, c = np.random.default_rng(seed), Combination(form, (0,) * len(form.features))
    t = np.exp(rng.uniform(np.log(0.03), np.log(0.5), (1, len(form.features))))
    return np.asarray(c.values(t) * rng.uniform(tight, 1.2, (1, len(form.outputs))))


def by_hand(form: Form, t: np.ndarray) -> np.ndarray:
    """Values (requirements,) straight from the definition."""
    found = []
    for row in range(len(form.outputs)):
        m = np.array([feature.ways[0].linear[row] for feature in form.features])
        s = np.array([feature.ways[0].spread[row] for feature in form.features]) * t
        matrix = np.eye(len(s)) if form.correlation is None else form.correlation
        found.append(m @ t + np.sqrt(s @ matrix @ s))
    return np.array(found)


CASES = [(9, 3, 0.0, False), (9, 5, 0.4, False), (9, 1, 0.0, True), (9, 4, 0.2, True)]


@pytest.mark.parametrize(("n", "rows", "shift", "correlated"), CASES)
def test_optimum_is_that_of_another_method(n: int, rows: int, shift: float, correlated: bool) -> None:
    """Sequential quadratic programmes in the logarithms of tolerances, slopes by differences."""
    form = form_of(n, rows, shift, correlated)
    limits = limits_of(form)
    found = least_cost(form, limits)
    curves = [feature.ways[0].curve for feature in form.features]
    other = minimize(
        lambda x: sum(float(c.cost(np.exp(x[i : i + 1]))[0]) for i, c in enumerate(curves)),
        np.full(n, np.log(0.01)),
        bounds=[(np.log(LOW), np.log(HIGH))] * n,
        constraints=[{"type": "ineq", "fun": lambda x: limits[0] / by_hand(form, np.exp(x)) - 1.0}],
        method="SLSQP",
        options={"maxiter": 500, "ftol": 1e-12},
    )
    assert np.all(by_hand(form, found.t[0]) <= limits[0] * (1.0 + 1e-12))
    np.testing.assert_allclose(found.cost[0], float(other.fun), rtol=1e-5)
    np.testing.assert_allclose(found.bound, found.cost, rtol=1e-8)


@pytest.mark.parametrize(
    ("n", "rows", "shift", "correlated"),
    [CASES[0], *(pytest.param(*case, marks=pytest.mark.slow) for case in CASES[1:])],
)
def test_optimum_is_that_of_a_trust_region_method(n: int, rows: int, shift: float, correlated: bool) -> None:
    form = form_of(n, rows, shift, correlated)
    limits = limits_of(form)
    found = least_cost(form, limits)
    curves = [feature.ways[0].curve for feature in form.features]
    other = minimize(
        lambda t: sum(float(c.cost(t[i : i + 1])[0]) for i, c in enumerate(curves)),
        np.full(n, 0.01),
        bounds=[(LOW, HIGH)] * n,
        constraints=[{"type": "ineq", "fun": lambda t: limits[0] - by_hand(form, t)}],
        method="COBYQA",
        options={"maxfev": 500, "final_tr_radius": 1e-8},
    )
    assert np.all(by_hand(form, found.t[0]) <= limits[0] * (1.0 + 1e-12))
    assert found.cost[0] <= float(other.fun) * (1.0 + 1e-5)
    np.testing.assert_allclose(found.bound, found.cost, rtol=1e-8)


def test_no_allocation_costs_less_than_the_bound() -> None:
    form = form_of(6, 4, 0.2, correlated=True, seed=3)
    c, limits = Combination(form, (0,) * 6), limits_of(form)
    found = least_cost(form, limits)
    rng = np.random.default_rng(0)
    t = np.clip(found.t * np.exp(rng.normal(0.0, 0.3, (20_000, 6))), LOW, HIGH)
    kept = np.all(c.values(t) <= limits, axis=1)
    assert kept.sum() > 100
    assert np.all(c.cost(t[kept]) >= found.bound[0])


def test_sums_and_roots_at_many_limits_are_solved_by_prices(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three roots of squares and two plain sums at 60 sets of limits: what SLSQP finds for each alone."""
    form, rng = form_of(8, 5, seed=4), np.random.default_rng(2)
    plain = tuple(
        replace(f, ways=(replace(f.ways[0], linear=(0.0,) * 3 + tuple(rng.uniform(0.2, 1.0, 2)),
                                 spread=(*f.ways[0].spread[:3], 0.0, 0.0)),))
        for f in form.features
    )  # fmt: skip
    programme = Programme(Combination(replace(form, features=plain), (0,) * 8))
    t = np.exp(rng.uniform(np.log(0.01), np.log(1.5), (60, 8)))
    limits = programme.combination.values(t) * rng.uniform(0.7, 1.3, (60, 5))
    limits[:10, 1] = np.inf
    with monkeypatch.context() as patched:
        patched.setattr(Programme, "_solved_by_prices", lambda self, limits: None)
        each = programme.least_cost(limits)
    monkeypatch.setattr("tolevo.algorithms.exact.programme.slsqp", None)
    found = programme.least_cost(limits)
    np.testing.assert_allclose(found.cost, each.cost, rtol=1e-8)
    np.testing.assert_allclose(found.bound, found.cost, rtol=1e-9)
    assert np.all(programme.combination.values(found.t) <= limits)
    assert np.count_nonzero(np.count_nonzero(found.multiplier > 0.0, axis=1) >= 2) > 20


def test_hundreds_of_requirements_are_proven() -> None:
    form = form_of(12, 300)
    found = least_cost(form, limits_of(form, tight=1.0))
    np.testing.assert_allclose(found.bound, found.cost, rtol=1e-9)
    binding = found.multiplier[0] > 0.0
    c = Combination(form, (0,) * 12)
    slack = limits_of(form, tight=1.0)[0] - c.values(found.t)[0]
    assert 0 < binding.sum() <= 12
    np.testing.assert_allclose(slack[binding], 0.0, atol=1e-7)  # complementary slackness


def test_both_solvers_agree_on_one_requirement() -> None:
    form = form_of(9, 1, 0.3)
    c, limits = Combination(form, (0,) * 9), np.array([[0.4], [1.0], [3.0]])
    np.testing.assert_allclose(Programme(c).least_cost(limits).cost, Path(c).least_cost(limits).cost, rtol=1e-10)


def test_full_correlation_is_the_worst_case() -> None:
    form = form_of(4, 1)
    ways = [feature.ways[0] for feature in form.features]
    spread = [abs(way.spread[0]) for way in ways]
    whole = tuple(
        Feature(f.variable, (Way(w.curve, LOW, HIGH, (0.0,), (a,)),))
        for f, w, a in zip(form.features, ways, spread, strict=True)
    )
    summed = tuple(
        Feature(f.variable, (Way(w.curve, LOW, HIGH, (a,), (0.0,)),))
        for f, w, a in zip(form.features, ways, spread, strict=True)
    )
    correlated = Form(("v",), whole, np.zeros(1), np.zeros(1), "", correlation=np.ones((4, 4)))
    worst_case = Form(("v",), summed, np.zeros(1), np.zeros(1), "")
    limit = np.array([[0.5]])
    np.testing.assert_allclose(least_cost(correlated, limit).cost, least_cost(worst_case, limit).cost, rtol=1e-9)


def test_limits_that_contradict_each_other_are_not_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    """A shift raises one requirement as much as it lowers the other; both have the same spread.

    Shifts sum to nothing, so that limits whose sum is below twice the least spread contradict each
    other: SLSQP would only find that it cannot go on, after thousands of evaluations.
    """
    flat, curve = ReciprocalPower(0.0, 1e-9, 1.0), ReciprocalPower(0.0, 0.1, 1.0)
    shift = Way(flat, LOW, HIGH, (1.0, -1.0), (0.0, 0.0))
    spread = Way(curve, 0.1, HIGH, (0.0, 0.0), (1.0, 1.0))
    features = (Feature("shift", (shift,)), Feature("t", (spread,)))
    form = Form(("up", "down"), features, np.zeros(2), np.zeros(2), "")
    programme = Programme(Combination(form, (0, 0)))
    found = programme.allocation(np.array([1.15, -0.85]))
    assert found is not None
    assert found[1] == pytest.approx(0.15, rel=1e-4)
    monkeypatch.setattr("tolevo.algorithms.exact.programme.slsqp", None)
    assert programme.allocation(np.array([1.09, -0.91])) is None
