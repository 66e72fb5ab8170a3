"""Roots of squares, by prices of the squares: every choice of ways by another solver, and by hand.

A part costs a + b/t, a requirement is the root of the sum of (a_j t_j)^2.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import optimize

from tolevo.algorithms.exact import separable
from tolevo.algorithms.exact.separable import Leaf, Squares, is_separable_without_doubt, least_leaf
from tolevo.models.capability import Surplus
from tolevo.models.costs import Reciprocal, ReciprocalPower
from tolevo.problems.forms import Feature, Form, Way

minimize: Any = optimize.minimize  # its stubs know arrays of one fixed dimension only
Array = np.ndarray
INF = np.inf


def form_of(seed: int, ways: tuple[int, ...], rows: int, power: float = 1.0) -> Form:
    """Parts with ways that are the dearer the tighter they go."""
    rng = np.random.default_rng(seed)

    def way(index: int) -> Way:
        b = float(rng.uniform(0.02, 0.3))
        curve = Reciprocal(0.4 * index * float(rng.uniform(0.5, 1.5)), b)
        other = ReciprocalPower(curve.a, b, power)
        low = 0.1 / 2.0**index * float(rng.uniform(0.8, 1.2))
        spread = tuple(float(one) for one in rng.uniform(0.5, 2.0, rows))
        return Way(other if power != 1.0 else curve, low, 4.0 * low, (0.0,) * rows, spread, (),
                   float(index))  # fmt: skip

    features = tuple(Feature(f"t{at}", tuple(way(i) for i in range(count)), "p", 1 + at % 2)
                     for at, count in enumerate(ways))  # fmt: skip
    return Form(tuple(f"v{row}" for row in range(rows)), features, np.full(rows, 0.01),
                np.full(rows, 1e-4), "", 0.5)  # fmt: skip


def costs_of_choices(form: Form, limit: Array) -> dict[tuple[int, ...], float]:
    """Least cost of every choice of ways by SLSQP in ln t, inf where the tightest break a limit."""
    found = {}
    asked, counts = np.isfinite(limit), np.array([f.count for f in form.features])
    for chosen in itertools.product(*(range(len(f.ways)) for f in form.features)):
        ways = [f.ways[w] for f, w in zip(form.features, chosen, strict=True)]
        low, high = np.array([w.low for w in ways]), np.array([w.high for w in ways])
        a = np.array([w.spread for w in ways]).T[asked]

        def cost(x: Array, ways: list[Way] = ways) -> float:
            each = [w.curve.cost(np.exp(x[at : at + 1]))[0] for at, w in enumerate(ways)]
            return float(0.5 + counts @ np.array(each))

        def room(x: Array, a: Array = a) -> Array:
            square = 1e-4 + np.sum((a * np.exp(x)) ** 2, axis=1)
            return np.asarray(1.0 - square / (limit[asked] - 0.01) ** 2)

        if np.any(room(np.log(low)) < 0.0):
            found[chosen] = INF
            continue
        best = minimize(cost, np.log(low), bounds=np.log(np.stack([low, high], axis=1)),
                        constraints=[{"type": "ineq", "fun": room}], method="SLSQP",
                        options={"ftol": 1e-12, "maxiter": 300})  # fmt: skip
        found[chosen] = float(best.fun)
    return found


def keeps(form: Form, leaf: Leaf, limit: Array) -> bool:
    ways = [f.ways[w] for f, w in zip(form.features, leaf.ways, strict=True)]
    square = sum((np.array(w.spread) * t) ** 2 for w, t in zip(ways, leaf.t, strict=True))
    inside = all(w.low <= t <= w.high for w, t in zip(ways, leaf.t, strict=True))
    return inside and bool(np.all(0.01 + np.sqrt(1e-4 + square) <= limit * (1.0 + 1e-14)))


@pytest.mark.parametrize("most", [400, 2])
@pytest.mark.parametrize(
    ("seed", "ways", "limit", "power"),
    [(0, (3, 3), (0.16,), 1.0), (1, (3, 2), (0.14,), 1.0), (2, (3, 3), (0.3,), 1.0),
     (3, (2, 3), (0.2, 0.25), 1.0), (4, (3, 3), (0.2, INF), 1.0), (5, (3, 2), (0.15, 0.15), 0.7),
     (6, (2, 2, 2), (0.2, 0.22), 1.0), (7, (2, 1, 3), (0.25,), 1.0)],
)  # fmt: skip
def test_the_least_of_all_choices_is_proven(
    monkeypatch: pytest.MonkeyPatch, seed: int, ways: tuple[int, ...], limit: tuple[float, ...], power: float, most: int
) -> None:
    """With the search cut short the bound still holds."""
    monkeypatch.setattr(separable, "LEAVES", most)
    form, limits = form_of(seed, ways, len(limit), power), np.array(limit)
    every = costs_of_choices(form, limits)
    least = min(every.values())
    assert np.isfinite(least)
    known: Leaf | None = None
    for _ in range(2):  # from nothing, and from what is known
        known, bound = least_leaf(Squares(form), limits, known)
        assert keeps(form, known, limits)
        assert bound <= least * (1.0 + 1e-7)
        assert known.cost == pytest.approx(every[known.ways], rel=1e-6)
        if most == 400:
            assert known.cost == pytest.approx(least, rel=1e-6)
            assert bound == pytest.approx(known.cost, rel=1e-9)


@pytest.mark.parametrize("seed", [0, 5])
def test_a_dear_choice_to_begin_with_is_left(seed: int) -> None:
    """The known leaf is that of another limit; no choice's bound is above its least cost."""
    form = form_of(seed, (3, 3), 2)
    wide, tight = np.array([0.5, 0.6]), np.array([0.17, 0.2])
    squares = Squares(form)
    for limit, other in ((tight, wide), (wide, tight)):
        every = costs_of_choices(form, limit)
        known, _ = least_leaf(squares, other, None)
        found, bound = least_leaf(squares, limit, known)
        assert found.cost == pytest.approx(min(every.values()), rel=1e-6)
        assert bound == pytest.approx(found.cost, rel=1e-9)
        for chosen, cost in every.items():
            own = squares.solve(chosen, squares.room(limit), None)
            assert own.cost >= cost * (1.0 - 1e-6)
            assert own.bound <= own.cost
            assert own.bound <= cost * (1.0 + 1e-7)


def one(ways: tuple[tuple[float, float, float, float], ...]) -> Form:
    """One part of ways (a, low, high, spread) with b = 1."""
    own = tuple(Way(Reciprocal(a, 1.0), low, high, (0.0,), (spread,), (), float(at))
                for at, (a, low, high, spread) in enumerate(ways))  # fmt: skip
    return Form(("v",), (Feature("t", own, "p"),), np.zeros(1), np.zeros(1), "")


def test_what_is_said_where_the_first_ways_keep_no_limit() -> None:
    """The first way of the least t breaks 0.5 by its spread of 10; the other one may be kept."""
    either = one(((0.0, 0.1, 1.0, 10.0), (0.0, 0.2, 1.0, 1.0)))
    found, bound = least_leaf(Squares(either), np.array([0.5]), None)
    assert np.isinf(found.cost) and bound <= 1.0 / 0.5
    found, bound = least_leaf(Squares(either), np.array([0.1]), None)
    assert np.isinf(found.cost) and np.isinf(bound) and bound > 0.0


def test_a_choice_is_what_costs_least_with_its_prices() -> None:
    """1/t under t <= 0.5, or 3 + 1/t under 0.1 t <= 0.5: 2 against 3 + 1/5; below 0.25 it turns."""
    form = one(((0.0, 0.01, 5.0, 1.0), (3.0, 0.01, 5.0, 0.1)))
    for limit, ways, cost in ((0.5, (0,), 2.0), (0.2, (1,), 3.5), (0.4, (0,), 2.5)):
        found, bound = least_leaf(Squares(form), np.array([limit]), None)
        assert found.ways == ways
        assert bound == pytest.approx(cost, rel=1e-9)
        assert found.cost == pytest.approx(cost, rel=1e-9)


def test_what_is_separable_but_for_doubt() -> None:
    form = form_of(0, (2, 2), 1)
    nothing = np.zeros(2)
    convex = Surplus(np.ones(2), nothing)
    at_one_limit = Surplus(np.ones(2), nothing, error=np.ones(2))
    assert not is_separable_without_doubt(form)
    assert is_separable_without_doubt(replace(form, surpluses=(convex,)))
    assert not is_separable_without_doubt(replace(form, surpluses=(at_one_limit,)))


def test_doubt_of_one_requirement_and_a_mean_beside_it() -> None:
    form, convex = form_of(0, (2, 2), 2), Surplus(np.ones(2), np.zeros(2))
    doubted = replace(form, surpluses=(None, convex))
    assert is_separable_without_doubt(doubted)
    shifted = replace(form.features[0].ways[0], linear=(0.0, 1.0))
    first = replace(form.features[0], ways=(shifted,))
    assert not is_separable_without_doubt(replace(doubted, features=(first, form.features[1])))


def test_a_limit_below_the_offset_leaves_no_room() -> None:
    """0.01 stands beside the root of 1e-4 and squares: -0.5 is no room of 0.51 squared."""
    form, limit = form_of(0, (2, 2), 1), np.array([-0.5])
    np.testing.assert_allclose(Squares(form).room(limit), [-1e-4])
    found, bound = least_leaf(Squares(form), limit, None)
    assert np.isinf(found.cost) and np.isinf(bound) and bound > 0.0


def test_what_is_separable() -> None:
    form = form_of(0, (2, 2), 2)
    assert separable.is_separable(form)
    assert not separable.is_separable(replace(form, correlation=np.eye(2)))
    shifted = replace(form.features[0].ways[0], linear=(0.0, 1.0))
    assert not separable.is_separable(
        replace(form, features=(replace(form.features[0], ways=(shifted,)), form.features[1]))
    )


@pytest.mark.parametrize(("first", "better"), [(1e-3, None), (0.3, None), (1e-3, 0.5), (0.3, 30.0), (30.0, 0.5)])
def test_prices_that_newton_did_not_find(monkeypatch: pytest.MonkeyPatch, first: float, better: float | None) -> None:
    """1/t under t <= 0.5: the price m of its square is 4 at best, t = (2 m)^(-1/3) at any.

    Where another search finds worse ones the better of both counts.
    """
    form = one(((0.0, 0.01, 5.0, 1.0),))
    monkeypatch.setattr(separable._Choice, "_newton", lambda *_: np.array([4.0 * first]))
    if better is not None:
        monkeypatch.setattr(separable._Choice, "_ascended", lambda *_: np.array([4.0 * better]))
    found, bound = least_leaf(Squares(form), np.array([0.5]), None)

    def bound_of(share: float) -> float:
        t = np.clip((1.0 / (8.0 * share)) ** (1.0 / 3.0), 0.01, 5.0)
        return float(1.0 / t + 4.0 * share * (t**2 - 0.25))

    def cost_of(share: float) -> float:
        return float(1.0 / min((1.0 / (8.0 * share)) ** (1.0 / 3.0), 0.5))

    shares = (first, 1.0) if better is None else (first, better)
    assert bound == pytest.approx(max(map(bound_of, shares)), rel=1e-6)
    assert found.cost == pytest.approx(min(map(cost_of, shares)), rel=1e-6)
    assert found.t[0] <= 0.5


@pytest.mark.parametrize("seed", [4, 6, 16])
def test_prices_are_found_beside_a_requirement_without_a_limit(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """Its price is nothing, and has no slope: without Newton's method the optimum is that of
    another solver, which does not know the requirement.
    """
    form = form_of(seed, (1, 1, 1, 1), 3)
    ways = [feature.ways[0] for feature in form.features]
    ends = [np.array([getattr(way, end) for way in ways]) for end in ("low", "high")]
    weights = np.array([way.spread for way in ways]).T ** 2
    least, most = (weights @ end**2 for end in ends)
    limits = 0.01 + np.sqrt(1e-4 + least + np.array([0.3, 0.4, 0.0]) * (most - least))
    limits[2] = INF
    monkeypatch.setattr(separable._Choice, "_newton", lambda _, room, asked, first: np.where(asked, 1e-3, 0.0))
    found, bound = least_leaf(Squares(form), limits, None)
    by_hand = costs_of_choices(form, limits)[(0, 0, 0, 0)]
    assert bound == pytest.approx(by_hand, rel=1e-6)
    assert found.cost == pytest.approx(by_hand, rel=1e-6)


@pytest.mark.parametrize("power", [1.0, 1.7])
def test_cost_and_bound_meet_wherever_the_limits_are(power: float) -> None:
    """Random choices whose limits leave from next to nothing to most of the ranges: some bind
    alone, some hold with room, tolerances lie at the ends of their ranges.
    """
    rng = np.random.default_rng(7)
    for _ in range(150):
        parts, rows = int(rng.integers(2, 10)), int(rng.integers(2, 6))
        form = form_of(int(rng.integers(1 << 30)), (1,) * parts, rows, power)
        squares = Squares(form)
        ends = [np.array([getattr(f.ways[0], end) for f in form.features])
                for end in ("low", "high")]  # fmt: skip
        weights = np.stack([own[0] for own in squares.squares], axis=1)
        least, most = (weights @ end**2 for end in ends)
        room = least + (most - least) * rng.uniform(5e-4, 0.9, rows) ** rng.uniform(0.5, 3.0)
        leaf = squares.solve((0,) * parts, room, None)
        assert leaf.cost - leaf.bound <= 1e-8 * leaf.cost
        assert np.all(weights @ leaf.t**2 <= room * (1.0 + 1e-12))


def two(constant: float = 0.0) -> Form:
    """One part 1/t under two requirements, each t and a constant under the root."""
    way = Way(Reciprocal(0.0, 1.0), 0.01, 5.0, (0.0, 0.0), (1.0, 0.0 if constant else 1.0))
    return Form(("v", "w"), (Feature("t", (way,)),), np.zeros(2), np.array([0.0, constant]), "")


@pytest.mark.parametrize("first", [(1e9, 0.0), (0.0, 1e9), (1e9, 1e9), (1e-9, 1e-9), (1e3, 0.0)])
def test_newton_finds_prices_from_any_others(monkeypatch: pytest.MonkeyPatch, first: tuple[float, float]) -> None:
    """t <= 0.6 and t <= 0.5: the first has no price in the end, the second one gets its own again
    where it was given up; where t stands at an end of its range prices move none the less.
    """
    monkeypatch.setattr(separable._Choice, "_ascended", lambda *_: pytest.fail("Newton suffices"))
    leaf = Squares(two()).solve((0,), np.array([0.36, 0.25]), np.array(first))
    assert leaf.cost == pytest.approx(2.0, rel=1e-12)
    assert leaf.bound == pytest.approx(2.0, rel=1e-12)
    np.testing.assert_allclose(leaf.mu, [0.0, 4.0], atol=1e-9)


@pytest.mark.parametrize("rough", [0.8, 1.2])
def test_newton_ends_what_another_search_has_begun(monkeypatch: pytest.MonkeyPatch, rough: float) -> None:
    """The price of t <= 0.5 is 4, that of t <= 0.6 nothing."""
    newton, asked = separable._Choice._newton, []

    def second(self: Any, *given: Any) -> Array:
        asked.append(given[2])
        return newton(self, *given) if len(asked) > 1 else np.array([0.0, 1e-3])

    monkeypatch.setattr(separable._Choice, "_newton", second)
    monkeypatch.setattr(separable._Choice, "_ascended", lambda *_: np.array([0.0, 4.0 * rough]))
    leaf = Squares(two()).solve((0,), np.array([0.36, 0.25]), None)
    assert leaf.bound == pytest.approx(2.0, rel=1e-12)
    assert leaf.cost == pytest.approx(2.0, rel=1e-12)


def test_a_room_of_nothing_asks_nothing_of_what_it_does_not_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second requirement is its constant alone, and its limit just that."""
    form, limit = two(0.09), np.array([0.5, 0.3])
    squares = Squares(form, constant=np.array([0.0, 0.3**2]))
    assert squares.room(limit)[1] == 0.0
    monkeypatch.setattr(separable._Choice, "_newton", lambda *_: np.array([1e-3, 0.0]))
    leaf = squares.solve((0,), squares.room(limit), None)
    assert leaf.cost == pytest.approx(2.0, rel=1e-6)
    assert leaf.bound == pytest.approx(2.0, rel=1e-6)


def test_newton_gives_a_price_only_to_what_has_one_from_the_other_search() -> None:
    """A choice of four parts under three limits: with a price for each of them the gap was 2e-9."""
    form = form_of(807668444, (1,) * 4, 3, 1.7)
    share = (0.06688973737475645, 0.14058416898755802, 0.024999163348454503)
    squares = Squares(form)
    ends = [np.array([getattr(f.ways[0], end) for f in form.features]) for end in ("low", "high")]
    weights = np.stack([own[0] for own in squares.squares], axis=1)
    least, most = (weights @ end**2 for end in ends)
    leaf = squares.solve((0,) * 4, least + (most - least) * np.array(share), None)
    assert leaf.cost - leaf.bound <= 1e-11 * leaf.cost


def test_every_choice_is_listed_once_the_least_excess_first() -> None:
    """All 18 of parts with 3, 1, 2 and 3 ways."""
    form = form_of(3, (3, 1, 2, 3), 1)
    excess = [np.array(one) for one in ([0.0, 2.0, 0.7], [0.0], [-0.5, 0.0], [1.0, 0.0, 0.3])]
    anchor = Leaf((0, 0, 1, 1), np.ones(4), 1.0, 1.0, np.ones(1))
    listed = list(separable._choices_by_excess(Squares(form), excess, anchor))
    every = list(itertools.product(range(3), range(1), range(2), range(3)))
    assert sorted(ways for _, ways in listed) == every
    totals = [sum(e[w] for e, w in zip(excess, ways, strict=True)) for _, ways in listed]
    assert totals == pytest.approx([total for total, _ in listed])
    assert totals == sorted(totals)
