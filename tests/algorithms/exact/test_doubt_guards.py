"""Steps of the reweighted roots by hand, and how many are taken; no time is measured."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tolevo.algorithms.exact import separable as doubt
from tolevo.algorithms.exact.choices import cost_range, is_enumerable_root_form, least_cost
from tolevo.algorithms.exact.combination import Combination
from tolevo.algorithms.exact.separable import (
    GAP,
    Leaf,
    _move_within_limit,
    _Reweighted,
    least_cost_under_doubt,
    least_leaf,
)
from tolevo.models.capability import Surplus
from tolevo.models.costs import Reciprocal
from tolevo.models.propagation.convolution import EvenPlateau
from tolevo.problems.forms import Feature, Form, Piece, Quantile, Way
from tolevo.section import Array

INF = np.inf


def drawn(parts: int = 5, rows: int = 1) -> Form:
    """Parts that cost b/t under roots; only the first has a surplus of doubt."""
    rng = np.random.default_rng(parts)
    features = tuple(
        Feature(f"t{at}", (Way(Reciprocal(0.0, float(rng.uniform(0.2, 4.0))), 0.1, 50.0,
                               (0.0,) * rows, tuple(rng.uniform(0.5, 2.0, rows).tolist())),))
        for at in range(parts)
    )  # fmt: skip
    surplus = Surplus(rng.uniform(0.3, 1.5, parts), rng.uniform(0.0, 0.4, parts))
    return Form(tuple("vw"[:rows]), features, np.zeros(rows), np.zeros(rows), "",
                surpluses=(surplus, None)[:rows])  # fmt: skip


class Bounded:
    """`least_leaf` that counts its calls, and gives other bounds from a call on."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, lost: int = 1000) -> None:
        self.calls, self.lost = 0, lost
        monkeypatch.setattr(doubt, "least_leaf", self)

    def __call__(self, *given: Any) -> tuple[Leaf, float]:
        self.calls += 1
        leaf, bound = least_leaf(*given)
        return leaf, -INF if self.calls > self.lost else bound


def test_the_best_bound_counts_and_never_less_than_the_floor(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first bound is the least cost without doubt; the others are lost here, or all are."""
    form, limits = drawn(), np.array([[6.0]])
    plain, best = least_cost(replace(form, surpluses=()), limits), least_cost(form, limits)
    stub = Bounded(monkeypatch, lost=1)
    found = least_cost(form, limits)
    assert found.bound[0] == pytest.approx(plain.cost[0])
    assert found.cost[0] == pytest.approx(best.cost[0])
    assert stub.calls < doubt.DOUBT_STEPS  # it ends where the squares are settled, whatever the gap
    Bounded(monkeypatch, lost=0)
    assert least_cost(form, limits).bound[0] == cost_range(form)[0]


def test_steps_end_where_the_gap_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Early allocations, far from settled, are not drawn back within the limits."""
    gaps, keep, stub = [], _Reweighted._keep, Bounded(monkeypatch)

    def noted(own: _Reweighted, *given: Any) -> None:
        keep(own, *given)
        gaps.append((own.cost - own.bound) / own.cost)

    monkeypatch.setattr(_Reweighted, "_keep", noted)
    least_cost(drawn(), np.array([[6.0]]))
    assert [gap <= GAP for gap in gaps] == [False] * (len(gaps) - 1) + [True]
    assert 1 <= len(gaps) <= stub.calls - 2
    assert stub.calls < doubt.DOUBT_STEPS


def test_what_is_impossible_takes_one_step(monkeypatch: pytest.MonkeyPatch) -> None:
    stub = Bounded(monkeypatch)
    found = least_cost(drawn(), np.array([[1e-3]]))
    assert np.isinf(found.cost[0]) and np.isinf(found.bound[0])
    assert stub.calls == 1


def test_a_root_without_doubt_beside_one_with() -> None:
    """Asked for alone it costs what it costs without any doubt."""
    form, limits = drawn(rows=2), np.array([[INF, 6.0]])
    found = least_cost_under_doubt(form, limits, 0.0)
    plain = least_cost(replace(form, surpluses=()), limits)
    assert found.cost[0] == pytest.approx(plain.cost[0], rel=1e-9)
    assert found.bound[0] == pytest.approx(plain.cost[0], rel=1e-6)


def test_a_leaf_that_no_way_leads_back_from(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tightest keep the limit without doubt, and break it with it."""
    form = drawn()
    least = [float(Combination(one, (0,) * 5).values(np.full((1, 5), 0.1))[0, 0])
             for one in (replace(form, surpluses=()), form)]  # fmt: skip
    monkeypatch.setattr(doubt, "DOUBT_STEPS", 1)
    found = least_cost(form, np.array([[0.5 * sum(least)]]))
    assert np.isinf(found.cost[0]) and np.isfinite(found.bound[0])


def test_the_cheapest_allocation_is_kept() -> None:
    form, limit = drawn(), np.array([6.0])
    own = _Reweighted(form, limit, None)
    leaf, _ = least_leaf(own._squares(), limit, None)
    own._keep(leaf, own._squares())
    cost, t = own.cost, own.t
    own._keep(replace(leaf, t=np.full(5, 0.1)), own._squares())
    assert own.cost == cost
    assert own.t is t


def test_steps_are_logarithms_where_both_squares_are_there() -> None:
    own = _Reweighted(drawn(4), np.array([6.0]), np.array([[1.0, 0.0, 2.0, 0.0]]))
    step = own._step(np.array([[0.0, 3.0, 2.0 * np.exp(1.0), 0.0]]))
    np.testing.assert_allclose(step, [[0.0, 0.0, 1.0, 0.0]], atol=1e-15)


@pytest.mark.parametrize("ratio", [-0.5, 0.2, 0.4])
def test_steps_of_one_ratio_are_taken_to_their_limit(ratio: float) -> None:
    """The sum of a geometric series; a square that is new is taken as it is."""
    reference, last = np.array([[1.0, 2.0, 0.0]]), np.array([[0.1, -0.2, 0.0]])
    own = _Reweighted(drawn(3), np.array([6.0]), reference)
    step = ratio * last
    end = own._drawn(np.array([[1.0, 1.0, 5.0]]), step, last)
    series = sum(step * ratio**k for k in range(200))
    np.testing.assert_allclose(end, [[*(reference * np.exp(series))[0, :2], 5.0]])


def test_steps_of_nothing_stay() -> None:
    reference, nothing = np.array([[1.0, 2.0, 3.0]]), np.zeros((1, 3))
    own = _Reweighted(drawn(3), np.array([6.0]), reference)
    np.testing.assert_array_equal(own._drawn(2.0 * reference, nothing, nothing), reference)


# ------------------------------------------------------------------------------ back to the limits


class Values:
    """One tolerance from 1 on, and its values."""

    low = np.ones(1)

    def __init__(self, *of: Any) -> None:
        self.of, self.calls = of, 0

    def values(self, t: Array) -> Array:
        self.calls += 1
        return np.array([[f(t[0, 0]) for f in self.of]])

    def within(self, t: float, *limit: float) -> Array | None:
        own: Any = self
        return _move_within_limit(own, np.array([t]), np.array(limit))


def test_one_chord_of_a_straight_line() -> None:
    own = Values(lambda t: t)
    assert own.within(3.0, 2.0) == [2.0]
    assert own.calls == 3  # both ends, and the place between


def test_chords_come_near_the_limit_and_stay_within() -> None:
    found = Values(lambda t: t * t).within(3.0, 4.0)
    assert found is not None
    assert 2.0 - 1e-2 <= found[0] <= 2.0
    assert Values(lambda t: t * t).within(1.9, 4.0) == [1.9]
    assert Values(lambda t: t * t).within(3.0, 0.9) is None


def test_a_chord_that_rounding_leads_beyond_the_limit_is_not_taken() -> None:
    """Here it is a root, which lies above its chord: the tightest is what is left."""
    assert Values(np.sqrt).within(9.0, 2.0) == [1.0]


def test_a_value_that_does_not_move_asks_for_no_way_back() -> None:
    """It has no chord: its room would be divided by nothing."""
    assert Values(lambda t: t, lambda t: 1.0).within(3.0, 2.0, 5.0) == [2.0]


def test_points_under_a_quantile_are_no_roots() -> None:
    way = Way(Reciprocal(1.0, 0.0), 1.0, 1.0, (0.0,), (1.0,))
    form = Form(("v",), (Feature("t", (way,)),), np.zeros(1), np.zeros(1), "")
    assert is_enumerable_root_form(form)
    quantile = Quantile(0.99, ((Piece(1.0, EvenPlateau()),),))
    assert not is_enumerable_root_form(replace(form, quantiles=(quantile,)))


def test_what_a_tangent_leaves_fixed_is_never_less_than_nothing() -> None:
    """A homogeneous surplus is its own tangent: what rounding leaves beside it is not taken off."""
    form, rng = drawn(), np.random.default_rng(0)
    for _ in range(200):
        own = _Reweighted(form, np.array([6.0]), rng.uniform(0.1, 9.0, (1, 5)))
        assert 0.0 <= own._squares().constant[0] <= 1e-12
