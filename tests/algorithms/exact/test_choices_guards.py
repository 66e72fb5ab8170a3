"""Guards of the search over alternative ways: who answers, what is solved, what is left out."""

from __future__ import annotations

import itertools
from dataclasses import replace
from math import comb
from typing import Any

import numpy as np
import pytest

from tests.algorithms.exact.parts_by_hand import INF, Array, Priced, by_hand, form, rough_or_fine, unused, way
from tolevo.algorithms.exact import choices
from tolevo.algorithms.exact.choices import contributions, has_compensation, least_cost, tightest_ways
from tolevo.algorithms.exact.combination import Combination
from tolevo.algorithms.exact.separable import Leaf, Squares, least_leaf
from tolevo.models.capability import Surplus
from tolevo.models.propagation.convolution import EvenPlateau
from tolevo.problems.forms import Feature, Form, Piece, Quantile, Way


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, ...]]:
    """The choices that are solved, in their order."""
    chosen: list[tuple[int, ...]] = []

    def noted(own: Form, ways: tuple[int, ...]) -> Combination:
        chosen.append(tuple(ways))
        return Combination(own, ways)

    monkeypatch.setattr(choices, "Combination", noted)
    return chosen


# -------------------------------------------------------------------- who answers


def test_points_under_doubt_are_proven_without_any_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """S^2 = sum of squares + a tenth of it, over all 27 choices."""
    monkeypatch.setattr(choices, "LEAVES", 0)
    table = ((0.5, 1.0), (0.2, 1.6), (0.1, 3.0))
    ways = [way(cost, 0.0, t, t, (0.0,), (1.0,)) for t, cost in table]
    own = form(ways, ways, ways, surpluses=(Surplus(np.zeros(3), np.full(3, 0.1)),))
    for limit in (0.2, 0.4, 0.6, 0.95):
        kept = [sum(cost for _, cost in chosen)
                for chosen in itertools.product(table, repeat=3)
                if np.sqrt(1.1 * sum(t * t for t, _ in chosen)) <= limit]  # fmt: skip
        found = least_cost(own, np.array([[limit]]))
        assert found.cost[0] == found.bound[0] == pytest.approx(min(kept), rel=1e-12)


def test_choices_under_doubt_are_proven_by_prices_of_squares(monkeypatch: pytest.MonkeyPatch) -> None:
    """b/t with 1.21 (0.1^2 + t1^2 + t2^2) <= L^2 in two ways each: what is made in one way to one
    tolerance is no choice, and nothing is left to the search of them.
    """
    monkeypatch.setattr(choices, "_Search", unused)
    ways = [way(0.0, 1.0, 0.3, 1.0, (0.0,), (1.0,)), way(0.4, 0.5, 0.1, 0.7, (0.0,), (1.0,))]
    fixed = [way(0.0, 0.0, 0.1, 0.1, (0.0,), (1.0,))]
    own = form(ways, ways, fixed, surpluses=(Surplus(np.zeros(3), np.full(3, 0.21)),))
    for limit in (0.25, 0.5, 0.8):
        found = least_cost(own, np.array([[limit]]))
        least = INF
        for one, other in itertools.product(ways, repeat=2):
            t = np.linspace(one.low, one.high, 20_001)
            left = np.sqrt(np.maximum(limit**2 / 1.21 - 0.01 - t**2, 0.0))
            u = np.minimum(left, other.high)
            cost = one.curve.cost(t) + other.curve.cost(np.maximum(u, other.low))
            least = min(least, float(np.min(cost[u >= other.low], initial=INF)))
        assert found.cost[0] == pytest.approx(least, rel=1e-6)
        assert found.bound[0] == pytest.approx(found.cost[0], rel=1e-9)


def test_prices_of_squares_are_not_asked_for_sums_with_a_mean(monkeypatch: pytest.MonkeyPatch) -> None:
    """1/t under 0.5 t + t <= 0.6: its square alone would allow t = 0.6."""
    monkeypatch.setattr(choices, "MAX_UNPRICED_COMBINATIONS", 1)
    ways = [way(a, 1.0, 0.1, high, (0.5,), (1.0,), Priced) for a, high in ((0.3, 2.0), (0.2, 0.35))]
    found = least_cost(form(ways), np.array([[0.6]]))
    assert found.cost[0] == pytest.approx(0.3 + 1.0 / 0.4, rel=1e-9)
    assert found.bound[0] == pytest.approx(found.cost[0], rel=1e-9)


POINTS = ((0.5, 1.0), (0.3, 1.7), (0.1, 3.5))
"""Tolerances that ways have, with what they cost."""


def at_points(*table: tuple[float, float]) -> list[Way]:
    return [way(cost, 0.0, t, t, (0.0,), (1.0,)) for t, cost in table]


def test_points_beside_a_range_are_searched_under_doubt(monkeypatch: pytest.MonkeyPatch) -> None:
    """1/u with 1.21 (t^2 + u^2) <= L^2: u is what a point t leaves of the limit."""
    monkeypatch.setattr(choices, "least_cost_under_doubt", unused)
    other = way(0.0, 1.0, 0.05, 2.0, (0.0,), (1.0,))
    own = form(at_points(*POINTS), [other], surpluses=(Surplus(np.zeros(2), np.full(2, 0.21)),))
    for limit in (0.45, 0.55, 0.8):
        least = min(cost + 1.0 / np.sqrt(limit**2 / 1.21 - t * t)
                    for t, cost in POINTS if limit**2 / 1.21 > t * t + 0.05**2)  # fmt: skip
        found = least_cost(own, np.array([[limit]]))
        assert found.cost[0] == pytest.approx(least, rel=1e-8)
        assert found.bound[0] == pytest.approx(least, rel=1e-7)


def test_points_are_listed_with_and_without_doubt() -> None:
    own = form(at_points(*POINTS), at_points(*POINTS))
    for limit in (0.15, 0.45, 0.55, 0.8):
        least = min(cost + other for (t, cost), (u, other) in itertools.product(POINTS, repeat=2)
                    if np.hypot(t, u) <= limit)  # fmt: skip
        found = least_cost(own, np.array([[limit]]))
        assert found.cost[0] == pytest.approx(least, rel=1e-12)
        assert found.bound[0] == pytest.approx(least, rel=1e-9)


def test_what_is_made_in_one_way_is_no_choice_of_a_master_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    """Six parts, one of them in two ways: all at their widest cost 6, the second way 0.5 less."""
    monkeypatch.setattr(choices, "Master", unused)
    one, other = (way(a, 1.0, 0.1, 1.0, (0.0,), (1.0,)) for a in (0.0, -0.5))
    quantile = Quantile(0.9, ((Piece(1.0, EvenPlateau()),),) * 6)
    own = form([one, other], *[[one]] * 5, quantiles=(quantile,))
    found = least_cost(own, np.array([[9.0]]))
    assert found.cost[0] == pytest.approx(5.5) and found.bound[0] <= 5.5


@pytest.mark.parametrize("roots", [1, 2])
def test_priced_curves_are_searched_by_squares_where_prices_of_one_root_do_not_do(
    monkeypatch: pytest.MonkeyPatch, roots: int
) -> None:
    """1/t or 1 + 0.5/t under t <= 0.4, and 2 t <= 0.9 beside it: 2.25 against 2.5."""
    monkeypatch.setattr(choices, "least_leaf" if roots == 1 else "_Search", unused)
    spread = (1.0, 2.0)[:roots]
    ways = [way(a, b, 0.1, 2.0, (0.0,) * roots, spread, Priced) for a, b in ((0.0, 1.0), (1.0, 0.5))]
    found = least_cost(form(ways), np.array([[0.4, 0.9][:roots]]))
    assert found.cost[0] == pytest.approx(2.25, rel=1e-8)
    assert found.bound[0] == pytest.approx(2.25, rel=1e-8)


# -------------------------------------------------------------------- many limits


def test_one_combination_is_solved_at_all_limits_at_once(
    monkeypatch: pytest.MonkeyPatch, solved: list[tuple[int, ...]]
) -> None:
    """Without prices: 1/t1 + 1/t2 under t1 + t2 <= L and twice it <= 3 L, so that t = L/2."""
    monkeypatch.setattr(choices, "tabulate_priced_costs", unused)
    part = way(0.0, 1.0, 0.01, 9.0, (1.0, 2.0), (0.0, 0.0))
    limits = np.array([0.5, 1.0, 2.0, 4.0])
    found = least_cost(form([part], [part]), np.stack([limits, 3.0 * limits], axis=1))
    np.testing.assert_allclose(found.cost, 4.0 / limits, rtol=1e-9)
    assert solved == [(0, 0)]


def test_no_limits_are_no_allocations_of_several_requirements() -> None:
    found = least_cost(rough_or_fine(2), np.empty((0, 2)))
    assert found.cost.shape == found.bound.shape == (0,) and found.t.shape == (0, 2)


def test_choices_under_one_requirement_are_solved_at_all_limits_at_once(solved: list[tuple[int, ...]]) -> None:
    """1/t or 1 + 0.5/t, two parts under t1 + t2 <= L: the second way pays below t = 0.5."""
    ways = [way(0.0, 1.0, 0.01, 9.0, (1.0,), (0.0,)), way(1.0, 0.5, 0.01, 9.0, (1.0,), (0.0,))]
    limits = np.array([0.4, 0.8, 2.0, 4.0])
    found = least_cost(form(ways, ways), limits[:, None])
    costs = [4.0 / limits, 1.0 + (1.0 + np.sqrt(0.5)) ** 2 / limits, 2.0 + 2.0 / limits]
    np.testing.assert_allclose(found.cost, np.min(costs, axis=0), rtol=1e-9)
    assert len(solved) == len(set(solved)) <= 4


def test_every_set_of_limits_has_its_own_number_of_allocations(monkeypatch: pytest.MonkeyPatch) -> None:
    own = rough_or_fine(3)
    limits = np.linspace(0.3, 2.0, 8)[:, None] * np.array([1.0, 1.1])
    monkeypatch.setattr(choices, "LEAVES", 8)
    found = least_cost(own, limits)
    np.testing.assert_allclose(found.cost, [by_hand(own, one) for one in limits], rtol=1e-7)
    np.testing.assert_allclose(found.bound, found.cost, rtol=1e-8)


def test_the_ways_of_the_limits_before_stand_for_the_tightest(solved: list[tuple[int, ...]]) -> None:
    own = rough_or_fine(3)
    limit = np.array([1.0, 1.1])
    tightest = tightest_ways(own)
    alone = least_cost(own, limit[None, :])
    first, best = list(solved), tuple(alone.chosen[0].tolist())
    assert best not in ((0, 0, 0), tightest)
    assert first[:2] == [(0, 0, 0), tightest]
    solved.clear()
    both = least_cost(own, np.stack([limit, 1.001 * limit]))
    assert solved[: len(first)] == first
    assert solved[len(first)] == best
    assert tightest not in solved[len(first) :]
    assert both.cost[0] == alone.cost[0] > both.cost[1]


def test_neighbours_of_prices_are_those_whose_limits_can_be_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[Leaf | None] = []

    def noted(squares: Squares, limit: Array, known: Leaf | None) -> Any:
        given.append(known)
        return least_leaf(squares, limit, known)

    monkeypatch.setattr(choices, "MAX_UNPRICED_COMBINATIONS", 1)
    monkeypatch.setattr(choices, "least_leaf", noted)
    ways = [way(a, b, 0.1, 2.0, (0.0,), (1.0,), Priced) for a, b in ((0.3, 1.0), (1.0, 0.5))]
    found = least_cost(form(ways, ways), np.array([[0.9], [0.01], [0.8], [0.7]]))
    assert np.isfinite(found.cost).tolist() == [True, False, True, True]
    assert [None if one is None else one.cost for one in given] == [None, *found.cost[[0, 0, 2]]]


# -------------------------------------------------------------------- what is left out


@pytest.mark.parametrize("correlation", [-0.9, 0.9])
def test_what_deviations_make_up_for_is_not_left_out(monkeypatch: pytest.MonkeyPatch, correlation: float) -> None:
    """Three points each: S^2 = s1^2 + s2^2 + 2 c s1 s2 by hand, over the nine choices."""
    monkeypatch.setattr(choices._Search, "_pick", lambda self, at: False)
    points = ((0.4, 1.7), (0.5, 1.0), (0.3, 3.0))
    ways = [way(cost, 0.0, t, t, (0.0,), (1.0,)) for t, cost in points]
    own = form(ways, ways, correlation=correlation)
    costs = {}
    for (t, cost), (u, other) in itertools.product(points, repeat=2):
        costs[float(np.sqrt(t * t + u * u + 2.0 * correlation * t * u))] = cost + other
    assert has_compensation(own) == (correlation < 0.0)
    for limit in sorted(costs):
        least = min(cost for value, cost in costs.items() if value <= limit)
        found = least_cost(own, np.array([[limit * (1.0 + 1e-9)]]))
        assert found.cost[0] == pytest.approx(least, rel=1e-6)
        assert found.bound[0] <= least
    below = least_cost(own, np.array([[min(costs) * 0.99]]))
    assert np.isinf(below.cost[0])


def test_alike_parts_are_solved_once_in_each_order_of_their_ways(
    monkeypatch: pytest.MonkeyPatch, solved: list[tuple[int, ...]]
) -> None:
    """Where no bound leaves anything out: choices of 3 ways for 4 parts are C(6, 4) = 15."""
    monkeypatch.setattr(choices._Search, "_bounds", lambda self, total: np.full(1, -INF))
    ways = [way(0.3 * at, 0.5**at, 0.1, 1.0, (0.5,), (1.0,)) for at in range(3)]
    least_cost(form(*[ways] * 4), np.array([[3.0]]))
    assert sorted(tuple(sorted(one)) for one in solved) == list(itertools.combinations_with_replacement(range(3), 4))
    assert len(solved) == comb(6, 4)


def test_alike_parts_do_not_change_places_where_they_are_correlated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 0.5 for 1 or 0.2 for 2: one of the two that are correlated by 0.9 is the tight one, with
    S^2 = 0.72; the third would leave 0.99.
    """
    monkeypatch.setattr(choices._Search, "_pick", lambda self, at: False)
    own = form(*[at_points((0.5, 1.0), (0.2, 2.0))] * 3, correlation=0.9)
    found = least_cost(own, np.array([[0.9]]))
    assert found.cost[0] == pytest.approx(4.0, rel=1e-12) and found.bound[0] <= 4.0
    assert found.chosen[0].tolist() in ([0, 1, 0], [1, 0, 0])


def test_alike_are_parts_of_the_same_ways_and_as_many_of_them() -> None:
    one, other = at_points(*POINTS), at_points(*POINTS[:2])
    own = form(one, one, other, other, other)
    fewer = replace(own.features[4], count=2)
    own = replace(own, features=(*own.features[:4], fewer))
    assert choices._repeated_features(own) == [False, True, False, True, False]


def test_least_contributions_by_hand() -> None:
    """A value that falls with a tolerance is least at its largest, with the way's own offset."""
    falling = replace(way(0.0, 1.0, 0.1, 2.0, (-3.0, 5.0), (1.0, 0.0)), offset=(0.5, -0.25))
    linear, square = contributions(Feature("t", (falling, way(0.0, 1.0, 0.2, 1.0, (1.0, -1.0), (2.0, 3.0)))))
    np.testing.assert_allclose(linear, [[-5.5, 0.25], [0.2, -1.0]])
    np.testing.assert_allclose(square, [[0.01, 0.0], [0.16, 0.36]])


def test_squares_add_up_under_roots_alone() -> None:
    """A uniform deviation of 0.5 at least: its 90 % quantile is 0.4, a root would be 0.5."""
    quantile = Quantile(0.9, ((Piece(1.0, EvenPlateau()),),))
    ways, limits = [way(0.0, 1.0, 0.5, 1.0, (0.0,), (1.0,))], np.array([[0.45], [0.55]])
    for rows, kept in (((quantile,), [True, True]), ((), [False, True])):
        least = choices._Least.of(form(ways, quantiles=rows))
        assert least.keeps((0,), limits).tolist() == kept


def test_what_cannot_be_cheaper_is_not_solved(solved: list[tuple[int, ...]]) -> None:
    """Of 243 choices; the bounds of one sum in the worst case leave few of them."""
    own = rough_or_fine(5)
    found = least_cost(own, np.array([[3.0, 3.5]]))
    assert found.bound[0] == pytest.approx(found.cost[0], rel=1e-8)
    assert len(solved) == len(set(solved)) <= 24


def test_a_bound_of_useless_prices_is_the_cost_without_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """At a thousand times the prices limits are worth more than everything costs."""
    own = rough_or_fine(3)
    floor = sum(min(w.curve.cost(np.array([w.high]))[0] for w in f.ways) for f in own.features)
    monkeypatch.setattr(choices, "LEAVES", 0)
    monkeypatch.setattr(choices, "PASSES", 0)
    monkeypatch.setattr(choices, "ROUNDS", 0)
    monkeypatch.setattr(choices, "GRID", np.array([1e3, 2e3]))
    found = least_cost(own, np.array([[1.0, 1.1]]))
    assert found.cost[0] > 1.1 * floor
    assert found.bound[0] == pytest.approx(floor, rel=1e-12)


def test_tangents_of_quantiles_allow_for_the_largest_parts_of_any_way() -> None:
    """Errors of their gradients count as often as a part may be large: 3 times 0.5 or 1 times 2."""
    quantile = Quantile(0.9, ((Piece(1.0, EvenPlateau()),),))
    ways = [way(0.0, 1.0, 0.1, 0.5, (0.0,), (3.0,)), way(0.0, 1.0, 0.1, 2.0, (0.0,), (-1.0,))]
    search = choices._Search(form(ways, quantiles=(quantile,)), np.array([[1.0]]))
    assert search.most is not None
    np.testing.assert_allclose(search.most, [[2.0]])
