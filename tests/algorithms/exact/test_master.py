"""Many ways by a linear master problem: against every set of ways, and allocations at random."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from tolevo.algorithms.exact import choices
from tolevo.algorithms.exact import choices as master
from tolevo.algorithms.exact.choices import GAP, Master, cost_range, least_cost
from tolevo.algorithms.exact.combination import Combination
from tolevo.models.costs import Reciprocal
from tolevo.models.propagation.convolution import EvenPlateau
from tolevo.problems.forms import Feature, Form, Piece, Quantile, Way


def drawn(seed: int, rows: int = 1, ways: int = 2, parts: int = 2) -> Form:
    """Parts of uniform errors, each made in one of several ways, under 90 and 99 % quantiles."""
    rng = np.random.default_rng(seed)
    features = []
    for at in range(parts):
        each = []
        for index in range(ways):
            low = float(rng.uniform(0.02, 0.1))
            curve = Reciprocal(float(rng.uniform(0.0, 2.0)), float(rng.uniform(0.02, 0.3)))
            linear, spread, offset = (rng.uniform(0.0, 0.4, rows), rng.uniform(0.5, 2.0, rows),
                                      rng.uniform(0.0, 0.1, rows))  # fmt: skip
            high = low * float(rng.uniform(2.0, 5.0))
            each.append(Way(curve, low, high, tuple(linear), tuple(spread), tuple(offset),
                            float(index)))  # fmt: skip
        features.append(Feature(f"t{at}", tuple(each), f"p{at}", count=1 + at % 2))
    piece = (Piece(1.0, EvenPlateau()),)
    quantiles = tuple(Quantile(share, (piece,) * parts) for share in (0.9, 0.99)[:rows])
    return Form(tuple("vw"[:rows]), tuple(features), np.full(rows, 0.05), np.zeros(rows), "", 0.5,
                quantiles=quantiles)  # fmt: skip


def alone(form: Form, chosen: tuple[int, ...]) -> Form:
    """The form with one way for each part."""
    features = [replace(feature, ways=(feature.ways[way],), choice="")
                for feature, way in zip(form.features, chosen, strict=True)]  # fmt: skip
    return replace(form, features=tuple(features))


def sets_of_ways(form: Form) -> list[tuple[int, ...]]:
    return list(product(*(range(len(feature.ways)) for feature in form.features)))


def span(form: Form) -> tuple[np.ndarray, np.ndarray]:
    """The least and the largest values (r,) of the requirements, over all sets of ways."""
    ends = []
    for chosen in sets_of_ways(form):
        one = Combination(form, chosen)
        ends.append(one.values(np.stack([one.low, one.high])))
    return np.min(ends, axis=(0, 1)), np.max(ends, axis=(0, 1))


def solved(form: Form, limit: np.ndarray) -> tuple[float, float]:
    """Cost and bound by the master problem; inf where it proves that nothing keeps the limits."""
    problem = Master(form, limit, *cost_range(form))
    best = problem.run()
    if best is None:
        return np.inf, problem.proven
    one = Combination(form, best.chosen)
    assert np.all(one.values(best.t[None, :])[0] <= limit * (1.0 + 1e-9))
    assert float(one.cost(best.t[None, :])[0]) == pytest.approx(best.cost, rel=1e-12)
    return best.cost, best.bound


TIGHT_TO_LOOSE = (-0.1, 0.1, 1.2)
"""Limits between the least and the largest values; the first ones are impossible."""


@pytest.mark.parametrize(("form", "shares"), [
    (drawn(0), TIGHT_TO_LOOSE), pytest.param(drawn(0, rows=2), (0.2,), marks=pytest.mark.slow),
])  # fmt: skip
def test_every_set_of_ways(form: Form, shares: Sequence[float]) -> None:
    """By another solver, a set of ways at a time."""
    least, most = span(form)
    for share in shares:
        limit = least + share * (most - least)
        each = [least_cost(alone(form, one), limit[None, :]) for one in sets_of_ways(form)]
        by_hand = min(float(one.cost[0]) for one in each)
        cost, bound = solved(form, limit)
        if np.isinf(by_hand):
            assert np.isinf(cost) and np.isinf(bound)
            continue
        assert bound <= by_hand * (1.0 + 1e-9)
        assert cost == pytest.approx(by_hand, rel=2.0 * GAP)
        assert cost - bound <= 0.003 * cost  # a node may end with ways mixed a little


def uneven(form: Form) -> Form:
    """The form with the first way alone of its first part."""
    first = replace(form.features[0], ways=form.features[0].ways[:1])
    return replace(form, features=(first, *form.features[1:]))


def test_cuts_lie_below_every_allocation_of_parts_with_different_numbers_of_ways() -> None:
    """What the parts' spread does to a value is above all tangents, and near one of them."""
    form, rng = uneven(drawn(0, rows=2, ways=3)), np.random.default_rng(1)
    problem = Master(form, np.full(2, 1.0), *cost_range(form))
    assert [len(feature.ways) for feature in form.features] == [1, 3]
    nearest = np.full(2, np.inf)
    for chosen in sets_of_ways(form):
        one = Combination(form, chosen)
        t = rng.uniform(one.low, one.high, (2, 2))
        ways = [f.ways[way] for f, way in zip(form.features, chosen, strict=True)]
        moved = form.offset + sum(np.array(way.offset) for way in ways)
        moved = moved + t @ np.array([way.linear for way in ways])
        spread = one.values(t) - moved
        for row, direction, intercept in problem._cuts:
            s = t * np.array([way.spread[row] for way in ways])
            above = spread[:, row] - s @ direction - intercept
            assert np.all(above >= -1e-9)
            nearest[row] = min(nearest[row], float(np.min(above / spread[:, row])))
    assert np.all(nearest < 0.1)


def test_the_tightest_ways_are_solved_too_as_long_as_nothing_is_known() -> None:
    """The heaviest ways keep no limit that is below their least values; the others do."""
    form = drawn(2)
    lows = [[way.low for way in feature.ways] for feature in form.features]
    tight = tuple(int(np.argmin(one)) for one in lows)
    heavy = tuple(1 - way for way in tight)
    ends = [Combination(form, chosen) for chosen in (tight, heavy)]
    least = [float(one.values(one.low[None, :])[0, 0]) for one in ends]
    assert least[0] < least[1]
    limit = np.array([0.5 * sum(least)])
    problem = Master(form, limit, *cost_range(form))
    weight = [np.where(np.arange(2) == way, 0.7, 0.3) for way in heavy]
    problem._round(weight, ((0, 1), (0, 1)), np.zeros(2))
    assert problem.best is not None and problem.best.chosen == tight
    by_hand = float(least_cost(alone(form, tight), limit[None, :]).cost[0])
    assert problem.best.cost == pytest.approx(by_hand, rel=1e-6)


@pytest.mark.parametrize(("nodes", "rounds"), [(1, 1), (2, 60), (60, 1)])
def test_nothing_is_below_a_bound_that_was_cut_short(monkeypatch: pytest.MonkeyPatch, nodes: int, rounds: int) -> None:
    form = drawn(0)
    least, most = span(form)
    limit = least + 0.2 * (most - least)
    by_hand = min(float(least_cost(alone(form, one), limit[None, :]).cost[0])
                  for one in sets_of_ways(form))  # fmt: skip
    monkeypatch.setattr(master, "NODES", nodes)
    monkeypatch.setattr(master, "MASTER_ROUNDS", rounds)
    cost, bound = solved(form, limit)
    assert cost_range(form)[0] * (1.0 - 1e-12) <= bound <= by_hand * (1.0 + 1e-9)
    assert cost >= by_hand * (1.0 - 2.0 * GAP)


def test_a_limit_that_is_none_does_not_count() -> None:
    form = drawn(1, rows=2)
    least, most = span(form)
    limit = least + 0.2 * (most - least)
    first = replace(form, outputs=("v",), offset=form.offset[:1], constant=form.constant[:1],
                    quantiles=form.quantiles[:1],
                    features=tuple(first_row(feature) for feature in form.features))  # fmt: skip
    one = solved(first, limit[:1])
    both = solved(form, np.array([limit[0], np.inf]))
    assert both == pytest.approx(one, rel=2.0 * GAP)
    free = solved(form, np.full(2, np.inf))
    cheapest = 0.5 + sum(f.count * min(float(w.curve.cost(np.array([w.high]))[0]) for w in f.ways)
                         for f in form.features)  # fmt: skip
    assert free == pytest.approx((cheapest, cheapest), rel=GAP)


def first_row(feature: Feature) -> Feature:
    return replace(feature, ways=tuple(
        replace(way, linear=way.linear[:1], spread=way.spread[:1], offset=way.offset[:1])
        for way in feature.ways))  # fmt: skip


def test_prices_of_any_size_bound_the_cost_of_all_that_keep_the_limits() -> None:
    """Random prices of the cuts, against allocations drawn at random."""
    form, rng = drawn(2), np.random.default_rng(0)
    least, most = span(form)
    limit = least + 0.3 * (most - least)
    problem = Master(form, limit, *cost_range(form))
    open_ = np.ones(len(problem._ways), dtype=bool)
    kept = []
    for chosen in sets_of_ways(form):
        one = Combination(form, chosen)
        t = rng.uniform(one.low, one.high, (20, 2))
        kept.append(one.cost(t[np.all(one.values(t) <= limit, axis=1)]))
    cheapest = float(np.concatenate(kept).min())
    for _ in range(200):
        prices = rng.exponential(1.0, len(problem._cuts)) * 10.0 ** rng.uniform(-3.0, 1.0)
        assert problem._lagrangian(prices, open_)[0] <= cheapest


def test_several_ways_of_quantiles_are_searched_by_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """From five parts with several ways on; a limit at a time, the same as by other means."""
    form = drawn(3)
    least, most = span(form)
    limits = least + np.array([[-0.1], [0.1], [0.5]]) * (most - least)
    monkeypatch.setattr(choices, "MIXED", 2)
    by_master = least_cost(form, limits)
    monkeypatch.setattr(choices, "MIXED", 3)
    otherwise = least_cost(form, limits)
    np.testing.assert_allclose(by_master.cost, otherwise.cost, rtol=2.0 * GAP)
    assert np.all(by_master.bound <= by_master.cost)
    assert np.isinf(by_master.cost[0]) and np.isinf(by_master.bound[0])
