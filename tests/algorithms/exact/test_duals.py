"""Weak duality by allocations drawn at random, and duals that follow by hand.

Whatever the multipliers are, no allocation that keeps the limits costs less than the dual; at those
of the optimum it is the optimum's cost.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tolevo.algorithms.exact.bounds import convex_pieces
from tolevo.algorithms.exact.choices import cheapest_choice_within_limits, is_enumerable_root_form
from tolevo.algorithms.exact.combination import Combination, Prices, pure_root_rows
from tolevo.models.capability import Surplus
from tolevo.models.costs import CostCurve, Exponential, Reciprocal, Table
from tolevo.problems.forms import Feature, Form, Spread, Way

B, SLOPE = np.array([0.4, 0.9, 0.1]), np.array([1.0, 2.0, 0.5])
INF = np.inf


def form_of(
    linear: np.ndarray,
    spread: np.ndarray,
    offset: tuple[float, ...] = (0.0,),
    constant: tuple[float, ...] = (0.0,),
    ends: tuple[float, float] = (1e-3, 50.0),
    own: tuple[float, ...] = (),
    count: int = 1,
) -> Form:
    """Parts with C = 1 + b/t; `linear` and `spread` are (r, features)."""
    features = tuple(
        Feature(f"t{at}", (Way(Reciprocal(1.0, float(b)), *ends, tuple(linear[:, at]),
                               tuple(spread[:, at]), own),), count=count)
        for at, b in enumerate(B)
    )  # fmt: skip
    names = tuple(f"r{at}" for at in range(len(linear)))
    return Form(names, features, np.array(offset), np.array(constant), "", 0.5)


def dual(form: Form, multiplier: list[float], limit: list[float], t: np.ndarray) -> float:
    combination = Combination(form, (0,) * len(form.features))
    return float(combination.dual(np.array([multiplier]), np.array([limit]), t[None, :])[0])


@pytest.mark.parametrize("count", [1, 3])
def test_the_dual_of_a_root_at_its_optimum(count: int) -> None:
    """V = 0.1 + sqrt(0.04 + sum (a t)^2) <= 1.1: t_j^3 = n b_j / (2 mu a_j^2)."""
    form = form_of(np.zeros((1, 3)), SLOPE[None, :], (0.1,), (0.04,), count=count)
    room = np.sqrt(1.0 - 0.04)
    total = np.sum((count * B * SLOPE) ** (2.0 / 3.0)) ** 1.5
    t = (count * B / SLOPE**2) ** (1.0 / 3.0)
    t *= room / np.linalg.norm(SLOPE * t)
    cost = 0.5 + 3.0 * count + total / room
    assert 0.5 + count * np.sum(1.0 + B / t) == pytest.approx(cost, rel=1e-12)
    price = total / room**2 * (1.0 / room)
    assert dual(form, [price], [1.1], t) == pytest.approx(cost, rel=1e-11)
    assert dual(form, [price], [1.1], t) <= cost
    assert dual(form, [2.0 * price], [1.1], t) < cost * (1.0 - 1e-3)
    assert dual(form, [0.5 * price], [1.1], t) < cost * (1.0 - 1e-3)


def test_the_dual_of_a_sum_at_its_optimum() -> None:
    """V = 0.1 + sum (0.05 + m t) <= 1.25: t_j = sqrt(b_j / m_j) / sqrt(lambda)."""
    form = form_of(SLOPE[None, :], np.zeros((1, 3)), (0.1,), own=(0.05,))
    total = np.sum(np.sqrt(B * SLOPE))
    t = np.sqrt(B / SLOPE) / total
    assert 0.1 + 3 * 0.05 + SLOPE @ t == pytest.approx(1.25)
    cost = 3.5 + total**2
    assert dual(form, [total**2], [1.25], t) == pytest.approx(cost, rel=1e-11)
    assert dual(form, [1.5 * total**2], [1.25], t) < cost * (1.0 - 1e-3)


def test_a_limit_that_is_none_is_worth_nothing() -> None:
    both = form_of(np.vstack([SLOPE, SLOPE]), np.zeros((2, 3)), (0.0, 0.0), (0.0, 0.0))
    total = np.sum(np.sqrt(B * SLOPE))
    t = np.sqrt(B / SLOPE) / total
    assert dual(both, [total**2, 7.0], [1.0, INF], t) == pytest.approx(3.5 + total**2, rel=1e-11)
    roots = form_of(np.zeros((2, 3)), np.vstack([SLOPE, SLOPE]), (0.0, 0.0), (0.0, 0.0))
    alone = form_of(np.zeros((1, 3)), SLOPE[None, :])
    assert dual(roots, [3.0, 7.0], [1.0, INF], t) == pytest.approx(dual(alone, [3.0], [1.0], t))


def test_limits_below_what_is_there_anyway() -> None:
    """t = 1 is the only one: cost 3.5 + sum b; a root of 0.3 + 2.29 above a limit of 0."""
    form = form_of(np.zeros((1, 3)), SLOPE[None, :], (0.3,), ends=(1.0, 1.0))
    size = float(np.linalg.norm(SLOPE))
    found = dual(form, [2.0], [0.0], np.ones(3))
    assert found == pytest.approx(3.5 + B.sum() + 2.0 / (2.0 * size) * size**2, rel=1e-12)
    assert dual(form, [2.0], [1.3], np.ones(3)) == pytest.approx(
        3.5 + B.sum() + 1.0 / size * (size**2 - 1.0), rel=1e-12
    )


def mixed(rng: np.random.Generator) -> Form:
    """A root, a sum, and both with a constant; some parts in none of them."""
    linear, spread = rng.uniform(0.2, 2.0, (2, 3, 3)) * (rng.random((2, 3, 3)) < 0.7)
    linear[0], spread[1] = 0.0, 0.0
    return form_of(linear, spread, tuple(rng.uniform(-0.1, 0.1, 3)), (0.0, 0.0, 0.01), (0.01, 1.0),
                   (0.0, *rng.uniform(-0.02, 0.02, 2)), int(rng.integers(1, 3)))  # fmt: skip


@pytest.mark.parametrize("seed", range(12))
def test_no_allocation_that_keeps_the_limits_costs_less_than_any_dual(seed: int) -> None:
    rng = np.random.default_rng(seed)
    form = mixed(rng)
    combination = Combination(form, (0, 0, 0))
    t = np.exp(rng.uniform(np.log(0.01), 0.0, (2000, 3)))
    values, cost = combination.values(t), combination.cost(t)
    for trial in range(12):
        limit = np.quantile(values, rng.uniform(0.05, 0.9), axis=0)
        if trial % 3 == 0:
            limit[rng.integers(3)] = INF
        multiplier = rng.exponential(1.0, 3) * (rng.random(3) < 0.7) * 10.0 ** rng.uniform(-2, 2)
        kept = np.all(values <= limit, axis=1)
        near = t[rng.integers(len(t))]
        bound = combination.dual(multiplier[None, :], limit[None, :], near[None, :])[0]
        assert np.all(cost[kept] >= bound)


def test_prices_choose_the_cheapest_tolerance_of_every_way() -> None:
    """Against 20,001 tolerances of each way, of one curve and of several."""
    rng = np.random.default_rng(3)
    curves: list[list[CostCurve]] = [
        [Reciprocal(1.0, 0.3)] * 3,
        [Reciprocal(1.0, 0.3), Exponential(1.0, 2.0, 3.0), Reciprocal(0.0, 1.0)],
        [Table((0.05, 0.2, 2.0), (5.0, 2.0, 0.5))] * 2,
    ]
    for of_feature in curves:
        ways = tuple(
            Way(curve, *ends, tuple(rng.uniform(0, 1, 2) * (0, 1)), tuple(rng.uniform(0, 1, 2)),
                tuple(rng.uniform(0, 0.1, 2) * (0, 1)) if at else ())
            for at, (curve, ends) in enumerate(zip(
                of_feature, [(0.05, 0.5), (0.1, 2.0), (0.3, 0.3)], strict=False))
        )  # fmt: skip
        form = Form(("a", "b"), (Feature("t", ways, "p", 2),), np.zeros(2), np.zeros(2), "")
        spread = Combination(form, (0,)).spread_at(np.array([[0.3], [0.3]]))
        prices = Prices.at(form, np.array([[1.0, 2.0], [9.0, 0.0]]), np.ones((2, 2)), spread)
        t, cost = prices.ways(form.features[0], 0)
        for at, way in enumerate(ways):
            every = np.linspace(way.low, way.high, 20_001)
            m, a = np.array(way.linear), np.array(way.spread)
            for row in range(2):
                line = float(prices.linear[row] @ (m + prices.direction[row, :, 0] * a))
                offset = float(prices.linear[row] @ np.array(way.offset)) if way.offset else 0.0
                square = float(prices.square[row] @ a**2)
                all_costs = 2.0 * way.curve.cost(every) + line * every + square * every**2 + offset
                assert way.low <= t[at, row] <= way.high
                assert cost[at, row] <= all_costs.min() * (1.0 + 1e-12)
                assert cost[at, row] == pytest.approx(all_costs.min(), rel=1e-4)


def test_what_is_priced_by_its_square() -> None:
    """A root alone: no linear part, no offset of a way, no correlation, no doubt, and a spread."""
    linear, spread = np.zeros((5, 3)), np.zeros((5, 3))
    linear[1], spread[:2] = SLOPE, SLOPE
    nothing = np.zeros(5)
    form = form_of(linear, spread, tuple(nothing), (0.0, 0.0, 0.0, 0.1, 0.0))
    assert pure_root_rows(form).tolist() == [True, False, False, True, False]
    moved = replace(form.features[0].ways[0], offset=(0.0, 0.0, 0.0, 0.2, 0.0))
    features = (replace(form.features[0], ways=(moved,)), *form.features[1:])
    assert pure_root_rows(replace(form, features=features)).tolist() == [True, *[False] * 4]
    assert not np.any(pure_root_rows(replace(form, correlation=np.eye(3))))


def points(*choices: tuple[float, float, float]) -> Feature:
    """Ways of (t, cost, spread)."""
    return Feature("t", tuple(Way(Reciprocal(cost, 0.0), t, t, (0.1,), (spread,), (), float(at))
                              for at, (t, cost, spread) in enumerate(choices)), "p")  # fmt: skip


def test_all_choices_of_points_by_hand() -> None:
    """Values 0.1 (t1 + t2) + |(a1 t1, a2 t2)|: 5, 4.6, ... of nine choices by a loop."""
    first = points((3.0, 1.0, 1.0), (2.0, 2.0, 1.0), (1.0, 5.0, 1.0))
    second = points((4.0, 1.0, 1.0), (3.0, 1.5, 0.5), (1.0, 4.0, 1.0))
    form = Form(("v",), (first, second), np.zeros(1), np.zeros(1), "", 0.25)
    assert is_enumerable_root_form(form)
    every = {}
    for i, one in enumerate(first.ways):
        for j, other in enumerate(second.ways):
            value = 0.1 * (one.low + other.low) + np.hypot(one.spread[0] * one.low, other.spread[0] * other.low)
            every[i, j] = (value, 0.25 + float(one.curve.cost(np.ones(1))[0])
                           + float(other.curve.cost(np.ones(1))[0]))  # fmt: skip
    limits = [value for value, _ in every.values()] + [0.1, 2.9, 99.0]
    found = cheapest_choice_within_limits(form, np.array(limits)[:, None])
    for row, limit in enumerate(limits):
        fits = [cost for value, cost in every.values() if value <= limit * (1.0 + 1e-15)]
        assert found.cost[row] == found.bound[row]
        assert found.cost[row] == pytest.approx(min(fits)) if fits else np.isinf(found.cost[row])
        if fits:
            assert every[tuple(found.chosen[row].tolist())][1] == pytest.approx(min(fits))


def test_what_is_only_points(monkeypatch: pytest.MonkeyPatch) -> None:
    own = points((3.0, 1.0, 1.0), (2.0, 2.0, 1.0))
    form = Form(("v",), (own, own), np.zeros(1), np.zeros(1), "")
    ranged = replace(own, ways=(own.ways[0], replace(own.ways[1], high=2.5)))
    assert not is_enumerable_root_form(replace(form, features=(own, ranged)))
    assert not is_enumerable_root_form(replace(form, correlation=np.eye(2)))
    monkeypatch.setattr("tolevo.algorithms.exact.choices.MAX_COMBINATIONS", 3)
    assert not is_enumerable_root_form(form)
    monkeypatch.setattr("tolevo.algorithms.exact.choices.MAX_COMBINATIONS", 4)
    assert is_enumerable_root_form(form)


def test_ranges_are_cut_at_the_bends_inside_of_them_alone() -> None:
    bent = Table((0.1, 0.2, 0.4, 1.0), (9.0, 8.5, 2.0, 1.9))  # bends down at 0.2
    assert bent.bends == (0.2,)
    for low, high, edges in (
        (0.1, 1.0, [(0.1, 0.2), (0.2, 1.0)]),
        (0.2, 1.0, [(0.2, 1.0)]),
        (0.1, 0.2, [(0.1, 0.2)]),
        (0.3, 0.4, [(0.3, 0.4)]),
    ):
        way = Way(bent, low, high, (1.0,), (0.0,))
        form = Form(("v",), (Feature("t", (way,)),), np.zeros(1), np.zeros(1), "")
        assert [(w.low, w.high) for w in convex_pieces(form).features[0].ways] == edges


def test_all_choices_of_points_under_doubt_by_hand() -> None:
    """S^2 = q1 + q2 + c + |(own1 q1, own2 q2, shared1 q1 + shared2 q2)|, q = (a t)^2; a way may
    shift its requirement."""
    own, shared, constant = np.array([0.8, 0.3]), np.array([0.2, 0.4]), 0.5
    surplus = Surplus(own, shared)
    shifted = replace(points((2.0, 2.0, 1.0)).ways[0], offset=(0.7,))
    first = replace(points((3.0, 1.0, 1.0)), ways=(*points((3.0, 1.0, 1.0)).ways, shifted))
    second = points((4.0, 1.0, 1.0), (1.0, 4.0, 1.0))
    form = Form(("v",), (first, second), np.full(1, 0.3), np.full(1, constant), "",
                surpluses=(surplus,))  # fmt: skip
    every = []
    for one in first.ways:
        for other in second.ways:
            q = np.array([one.low**2, other.low**2])
            doubt = np.sqrt(np.sum((own * q) ** 2) + float(shared @ q) ** 2)
            value = 0.3 + 0.1 * (one.low + other.low) + sum(way.offset[0] for way in (one, other)
                                                            if way.offset)  # fmt: skip
            value += np.sqrt(q.sum() + constant + doubt)
            every.append((value, float(one.curve.cost(np.ones(1))[0])
                          + float(other.curve.cost(np.ones(1))[0])))  # fmt: skip
    assert len({round(value, 6) for value, _ in every}) == 4
    for limit, _ in every:
        fits = [cost for value, cost in every if value <= limit]
        found = cheapest_choice_within_limits(form, np.array([[limit * (1.0 + 1e-12)]]))
        assert found.cost[0] == pytest.approx(min(fits)) == found.bound[0]
        tighter = [cost for value, cost in every if value < limit * (1.0 - 1e-9)]
        found = cheapest_choice_within_limits(form, np.array([[limit * (1.0 - 1e-9)]]))
        assert found.cost[0] == (pytest.approx(min(tighter)) if tighter else np.inf)


def test_only_a_requirement_of_its_own_doubt_is_not_priced_by_its_square() -> None:
    spread = np.ones((2, 3))
    form = form_of(np.zeros((2, 3)), spread, (0.0, 0.0), (0.0, 0.0))
    doubted = replace(form, surpluses=(None, Surplus(np.ones(3), np.zeros(3))))
    assert pure_root_rows(doubted).tolist() == [True, False]


def test_a_root_of_nothing_has_no_price() -> None:
    """Where S is 0 its square has no slope: no division, and a price of V itself."""
    form = form_of(np.zeros((1, 3)), np.ones((1, 3)), (0.0,), (0.0,))
    nothing = Spread(np.zeros((1, 1)), np.zeros((1, 1, 3)), np.zeros((1, 1)))
    with np.errstate(all="raise"):
        found = Prices.at(form, np.full((1, 1), 2.0), np.full((1, 1), 3.0), nothing)
    assert (found.linear[0, 0], found.square[0, 0], found.received[0]) == (2.0, 0.0, 6.0)
