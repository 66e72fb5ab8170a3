"""Least cost under the doubt of processes: against a conic solver, chords, and a dense search."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from time import process_time
from typing import Any

import numpy as np
import pytest

from tolevo.algorithms.exact import separable as doubt
from tolevo.algorithms.exact.choices import least_cost
from tolevo.algorithms.exact.combination import Combination
from tolevo.algorithms.exact.programme import Programme
from tolevo.algorithms.exact.separable import Leaf, least_leaf
from tolevo.models.capability import Surplus
from tolevo.models.costs import Reciprocal
from tolevo.problems.forms import Feature, Form, Way, spread_of


def drawn(seed: int, parts: int, fixed: float = 0.0, one_limit: bool = False) -> Form:
    rng = np.random.default_rng(seed)
    spread, price = rng.uniform(0.5, 2.0, parts), rng.uniform(0.2, 4.0, parts)
    surplus = Surplus(rng.uniform(0.0, 1.5, parts), rng.uniform(0.0, 0.4, parts), fixed, fixed)
    if one_limit:
        surplus = Surplus(surplus.own, 0.0 * surplus.own, fixed, error=0.1 * surplus.shared,
                          fixed_error=0.1 * fixed, fixed_even=fixed)  # fmt: skip
    features = tuple(
        Feature(f"t{at}", (Way(Reciprocal(0.1, b), 0.01, 50.0, (0.0,), (a,)),))
        for at, (a, b) in enumerate(zip(spread.tolist(), price.tolist(), strict=True))
    )
    return Form(("promise",), features, np.zeros(1), np.full(1, fixed), "", surpluses=(surplus,))


@pytest.mark.parametrize(("parts", "fixed"), [(1, 0.0), (5, 0.3), (9, 0.0), (30, 1.0)])
def test_optimum_of_a_conic_solver(parts: int, fixed: float) -> None:
    """1e-6: the tolerance of Clarabel in units of the cost."""
    cvxpy: Any = pytest.importorskip("cvxpy", reason="the oracle comes with the extra dev")
    form, limit = drawn(parts, parts, fixed), 6.0
    surplus = form.surpluses[0]
    assert surplus is not None
    a = np.array([feature.ways[0].spread[0] for feature in form.features])
    b = np.array([feature.ways[0].curve.b for feature in form.features])  # type: ignore[attr-defined]
    t, square = cvxpy.Variable(parts), cvxpy.Variable(parts)
    own = cvxpy.hstack([cvxpy.multiply(surplus.own, square), fixed,
                        surplus.shared @ square + fixed])  # fmt: skip
    within = [cvxpy.square(cvxpy.multiply(a, t)) <= square, t >= 0.01, t <= 50.0,
              cvxpy.sum(square) + fixed + cvxpy.norm2(own) <= limit**2]  # fmt: skip
    problem = cvxpy.Problem(cvxpy.Minimize(b @ cvxpy.inv_pos(t)), within)
    problem.solve(solver="CLARABEL", tol_gap_abs=1e-10, tol_gap_rel=1e-10, tol_feas=1e-10)
    expected = float(problem.value) + 0.1 * parts
    found = least_cost(form, np.array([[limit]]))
    assert found.cost[0] == pytest.approx(expected, rel=1e-6)
    assert found.cost[0] - found.bound[0] <= 1e-9 * found.cost[0]
    combination = Combination(form, (0,) * parts)
    assert combination.values(found.t)[0, 0] <= limit


@pytest.mark.parametrize(("fixed", "one_limit"), [(0.0, False), (0.7, False), (0.7, True)])
def test_no_chord_lies_below_the_norm(fixed: float, one_limit: bool) -> None:
    """40,000 chords and as many tangents, with all terms: none above by more than rounding."""
    form, rng = drawn(3, 9, fixed, one_limit), np.random.default_rng(8)
    ends = 10.0 ** rng.uniform(-2.0, 1.5, (2, 40_000, 1, 9))
    share = rng.uniform(size=(40_000, 1, 1))
    middle = share * ends[0] + (1.0 - share) * ends[1]
    low, high, inner = (spread_of(form, s) for s in (*ends, middle))
    chord = share[:, :, 0] * low.value + (1.0 - share[:, :, 0]) * high.value
    assert np.all(inner.value <= chord * (1.0 + 1e-13))
    tangent = inner.intercept + np.sum(inner.direction * ends[0], axis=2)
    assert np.all(tangent <= low.value * (1.0 + 1e-13))


def test_the_general_programme_agrees() -> None:
    """SLSQP with tangents of the norm: another way to the same optimum and bound."""
    form, limits = drawn(5, 6, 0.2), np.array([[2.0], [5.0]])
    found = least_cost(form, limits)
    other = Programme(Combination(form, (0,) * 6)).least_cost(limits)
    np.testing.assert_allclose(found.cost, other.cost, rtol=1e-7)
    np.testing.assert_allclose(found.bound, other.bound, rtol=1e-6)


def test_one_limit_against_a_conic_solver() -> None:
    """a + sqrt(b^2 + c^2) as the largest of 181 sums of norms: 1e-4 below the whole circle."""
    cvxpy: Any = pytest.importorskip("cvxpy", reason="the oracle comes with the extra dev")
    form, limit = drawn(4, 4, 0.0, one_limit=True), 6.0
    surplus = form.surpluses[0]
    assert surplus is not None
    assert surplus.error is not None
    a = np.array([feature.ways[0].spread[0] for feature in form.features])
    b = np.array([feature.ways[0].curve.b for feature in form.features])  # type: ignore[attr-defined]
    t, square, root = cvxpy.Variable(4), cvxpy.Variable(4), cvxpy.Variable()
    s = cvxpy.multiply(a, t)
    even, mean = cvxpy.norm2(s), cvxpy.norm2(cvxpy.multiply(np.sqrt(surplus.error), s))
    within = [t >= 0.01, t <= 50.0]
    within += [cvxpy.quad_over_lin(s[at], root) <= square[at] for at in range(4)]
    within += [cvxpy.sum(square) + cvxpy.norm2(cvxpy.multiply(surplus.own, square)) <= root]
    for angle in np.linspace(0.0, 0.5 * np.pi, 181):
        cos, sin = float(np.cos(angle)), float(np.sin(angle))
        within.append((1.0 - cos) * even + cos * root + sin * mean <= limit)
    problem = cvxpy.Problem(cvxpy.Minimize(b @ cvxpy.inv_pos(t)), within)
    problem.solve(solver="CLARABEL")
    found = least_cost(form, np.array([[limit]]))
    assert found.cost[0] == pytest.approx(float(problem.value) + 0.4, rel=1e-4)
    assert found.bound[0] >= found.cost[0] * (1.0 - 1e-6)


def test_points_alone_are_all_looked_at() -> None:
    """Three machines for each of six parts: the cheapest of 729 by explicit sums."""
    rng, k = np.random.default_rng(2), 3.0
    std, price = rng.uniform(0.5, 1.5, (6, 3)), rng.uniform(1.0, 3.0, (6, 3))
    features = tuple(
        Feature(f"t{at}", tuple(Way(Reciprocal(p, 0.0), s, s, (0.0,), (k,)) for s, p in zip(
            std[at].tolist(), price[at].tolist(), strict=True)), f"p{at}")
        for at in range(6)
    )  # fmt: skip
    surplus = Surplus(np.full(6, 0.8), np.zeros(6))
    form = Form(("v",), features, np.zeros(1), np.zeros(1), "", surpluses=(surplus,))
    limits, at = np.array([[0.1], [8.0], [9.0]]), np.arange(6)
    found = least_cost(form, limits)
    for row, limit in enumerate(limits[:, 0].tolist()):
        costs = [
            float(price[at, ways].sum())
            for ways in map(list, product(range(3), repeat=6))
            if k * np.sqrt((v := std[at, ways] ** 2).sum() + 0.8 * np.linalg.norm(v)) <= limit
        ]
        assert found.cost[row] == pytest.approx(min(costs, default=np.inf))
        assert found.bound[row] == found.cost[row]


def test_points_beside_ranges_are_proven() -> None:
    """Two searched parts and three on one of two machines: the best of all eight choices."""
    form = drawn(6, 5)
    machines = tuple(
        replace(feature, ways=tuple(
            Way(Reciprocal(price, 0.0), s, s, (0.0,), feature.ways[0].spread)
            for price, s in ((1.0, 1.1), (1.7, 0.5 + 0.1 * at))), choice=f"p{at}")
        for at, feature in enumerate(form.features[2:])
    )  # fmt: skip
    mixed, limit = replace(form, features=(*form.features[:2], *machines)), np.array([[4.0]])
    each = [
        least_cost(replace(mixed, features=(*form.features[:2], *(
            replace(feature, ways=(feature.ways[way],))
            for feature, way in zip(machines, ways, strict=True)))), limit).cost[0]
        for ways in product((0, 1), repeat=3)
    ]  # fmt: skip
    found = least_cost(mixed, limit)
    assert found.cost[0] == pytest.approx(min(each), rel=1e-6)
    assert min(each) * (1.0 - 1e-4) <= found.bound[0] <= min(each) * (1.0 + 1e-9)


def test_ways_are_bound_together() -> None:
    """Two ways for each of four features: the best of all sixteen, none below the bound."""
    form = drawn(7, 4)
    features = tuple(
        replace(feature, ways=(feature.ways[0], replace(
            feature.ways[0], curve=Reciprocal(0.4, 0.3), spread=(1.7 + 0.1 * at,), high=2.0)))
        for at, feature in enumerate(form.features)
    )  # fmt: skip
    form, limit = replace(form, features=features), np.array([[3.0]])
    each = [
        least_cost(replace(form, features=tuple(
            replace(feature, ways=(feature.ways[way],))
            for feature, way in zip(features, ways, strict=True))), limit).cost[0]
        for ways in product((0, 1), repeat=4)
    ]  # fmt: skip
    found = least_cost(form, limit)
    assert found.cost[0] == pytest.approx(min(each), rel=1e-8)
    assert found.bound[0] <= min(each)
    assert found.bound[0] >= min(each) * (1.0 - 1e-2)  # other ways doubt less or more


def test_limits_out_of_reach_and_without_effect() -> None:
    found = least_cost(drawn(2, 3), np.array([[1e-3], [1e4]]))
    assert np.isinf(found.cost[0])
    assert np.isinf(found.bound[0])
    np.testing.assert_allclose(found.t[1], 50.0)


def test_a_requirement_without_doubt_beside_one_with() -> None:
    """Two machines for each of three parts: under its own root the second value has no surplus."""
    rng, own = np.random.default_rng(4), 0.7
    std, price = np.sort([rng.uniform(0.5, 1.5, (3, 2)), rng.uniform(1.0, 3.0, (3, 2))])
    price = price[:, ::-1]
    features = tuple(
        Feature(f"t{at}", tuple(
            Way(Reciprocal(price[at, way], 0.0), std[at, way], std[at, way], (0.0, 0.0), (1.0, 2.0))
            for way in (0, 1)), f"p{at}")
        for at in range(3)
    )  # fmt: skip
    form = Form(("v", "w"), features, np.zeros(2), np.zeros(2), "",
                surpluses=(Surplus(np.full(3, own), np.zeros(3)), None))  # fmt: skip
    every = [(np.arange(3), list(ways)) for ways in product((0, 1), repeat=3)]
    cost, v = np.array([price[one].sum() for one in every]), [std[one] ** 2 for one in every]
    first = np.array([np.sqrt(one.sum() + own * np.linalg.norm(one)) for one in v])
    second = np.array([2.0 * np.sqrt(one.sum()) for one in v])
    limits = np.array(list(product(first, second))) * (1.0 + 1e-12)
    expected = [np.min(cost[(first <= one) & (second <= other)], initial=np.inf)
                for one, other in limits]  # fmt: skip
    assert len(set(expected)) > 2
    np.testing.assert_allclose(least_cost(form, limits).cost, expected)


def test_a_bound_is_cut_at_the_cost(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where rounding, here of 1e-9, puts a relaxation above the allocation that it comes from."""

    def above(*given: Any) -> tuple[Leaf, float]:
        leaf, bound = least_leaf(*given)
        return leaf, bound * (1.0 + 1e-9)

    monkeypatch.setattr(doubt, "least_leaf", above)
    found = least_cost(drawn(5, 5, 0.3), np.array([[6.0]]))
    assert np.isfinite(found.cost[0])
    assert found.bound[0] == found.cost[0]


@pytest.mark.parametrize("steps", [1, 2])
def test_an_allocation_is_kept_where_the_steps_end_early(monkeypatch: pytest.MonkeyPatch, steps: int) -> None:
    """The last one, drawn back within the limit; the optimum lies between its bound and its cost"""
    form, limit = drawn(5, 5, 0.3), 6.0
    best = least_cost(form, np.array([[limit]])).cost[0]
    monkeypatch.setattr(doubt, "DOUBT_STEPS", steps)
    found = least_cost(form, np.array([[limit]]))
    assert found.bound[0] <= best * (1.0 + 1e-9)
    assert best * (1.0 - 1e-9) <= found.cost[0] <= 1.1 * best
    assert Combination(form, (0,) * 5).values(found.t)[0, 0] <= limit


@pytest.mark.timed
def test_assurance_costs_little_time() -> None:
    """At most three times the CPU of the plug-in's optimum; the least of several runs of each."""
    form, limit = drawn(1, 9), np.array([[5.0]])
    plain = replace(form, surpluses=())
    seconds = []
    for one in (plain, form):
        taken = []
        for _ in range(7):
            begun = process_time()
            least_cost(one, limit)
            taken.append(process_time() - begun)
        seconds.append(min(taken))
    assert seconds[1] <= 3.0 * seconds[0]
