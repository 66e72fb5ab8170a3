"""Prices of the search over alternative ways: where they begin, how they are renewed, what for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.algorithms.exact.parts_by_hand import INF, Array, by_hand, form, rough_or_fine, unused, way
from tolevo.algorithms.exact import choices
from tolevo.algorithms.exact.choices import GRID, least_cost
from tolevo.problems.forms import Form

SQUARES = [way(0.0, 1.0, 0.01, 9.0, (0.0,), (1.0,)), way(5.0, 1.0, 0.01, 9.0, (0.0,), (1.0,))]
"""1/t under t <= L costs 1/L and falls by 1/L^2 per unit of it; the second way is of no use."""


def begun(own: Form, *limits: Sequence[float]) -> choices._Search:
    """A search that has solved the first ways at these limits."""
    search = choices._Search(own, np.array(limits, dtype=float))
    search.leaf((0,) * len(own.features), np.ones(len(limits), dtype=bool))
    return search


def counted(monkeypatch: pytest.MonkeyPatch, owner: Any, name: str) -> list[None]:
    """One entry for every call of a method."""
    calls: list[None] = []
    real = getattr(owner, name)

    def call(*given: Any) -> Any:
        calls.append(None)
        return real(*given)

    monkeypatch.setattr(owner, name, call)
    return calls


@pytest.mark.parametrize("wrong", [1e6, 1e3, 1e-3, 1e-6])
def test_prices_that_are_far_too_high_or_low_are_found_again(wrong: float) -> None:
    search = begun(form(SQUARES), [0.5], [0.25])
    np.testing.assert_allclose(search.multiplier[:, 0], [4.0, 16.0], rtol=1e-6)
    search.multiplier *= wrong
    search.run()
    np.testing.assert_allclose(wrong * search.factor, 1.0, rtol=0.4)  # GRID's own steps


def test_prices_that_are_right_are_not_looked_for_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither by further passes nor, for one root, by an ascent: a table each for both ends."""
    monkeypatch.setattr(choices, "Ascent", unused)
    tables = counted(monkeypatch, choices._Search, "tabulate")
    begun(form(SQUARES), [0.5], [0.25]).run()
    assert len(tables) == 2


def test_prices_are_renewed_as_long_as_they_find_something_cheaper(monkeypatch: pytest.MonkeyPatch) -> None:
    left = [True, True, False]
    tables = counted(monkeypatch, choices._Search, "tabulate")
    monkeypatch.setattr(choices._Search, "_pick", lambda self, at: left.pop(0))
    begun(form(SQUARES), [0.5]).run()
    assert not left and len(tables) == 4


def test_what_prices_choose_is_solved_there_and_at_the_next_higher_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a table of three ways that says which is cheapest at each price of each limit."""
    search = choices._Search(form([SQUARES[0]] * 3), np.array([[0.5], [0.25]]))
    cheapest, last = np.zeros((len(GRID), 2), dtype=int), len(GRID) - 1
    cheapest[[4, 5, 7], [0, 0, 1]] = 1, 2, 2
    search.tables = [(np.arange(3)[:, None, None] != cheapest).astype(float)]
    asked: list[tuple[tuple[int, ...], list[bool]]] = []

    def noted(ways: tuple[int, ...], alive: NDArray[np.bool_]) -> None:
        asked.append((ways, alive.tolist()))

    monkeypatch.setattr(search, "leaf", noted)
    assert not search._pick(np.array([4, 7]))
    assert asked == [((1,), [True, False]), ((2,), [False, True]),
                     ((0,), [False, True]), ((2,), [True, False])]  # fmt: skip
    asked.clear()
    assert not search._pick(np.array([last, last]))
    assert asked == [((0,), [True, True])] * 2


def test_a_choice_by_prices_helps_where_something_is_cheaper() -> None:
    """1/t + 0.3 in place of 1/t + 5; the second time nothing is new."""
    search = begun(form([SQUARES[1], way(0.3, 1.0, 0.01, 9.0, (0.0,), (1.0,))]), [0.5])
    search.tabulate()
    assert search._pick(np.array([10]))
    assert search.cost[0] == pytest.approx(2.3) and search.chosen[0, 0] == 1
    assert not search._pick(np.array([10]))


@pytest.mark.parametrize("helped", [0, 1, 2])
def test_multipliers_are_improved_again_after_every_better_allocation(
    monkeypatch: pytest.MonkeyPatch, helped: int
) -> None:
    """Two sets of limits: each round asks for both; the last round's multipliers stay."""
    rounds: list[int] = []

    class Rising:
        def __init__(self, *given: object) -> None:
            assert len(given) == 3

        def multipliers(self, first: Array) -> Array:
            rounds.append(len(rounds))
            return np.full_like(first, 1.0 + len(rounds))

    def pick(self: choices._Search, at: object) -> bool:
        if len(rounds) <= 2 * helped:
            self.cost[0] -= 0.1
            self.ascended[0] = np.nan
        return False

    search = begun(rough_or_fine(2), [1.0, 1.1], [1.2, 1.3])
    monkeypatch.setattr(choices, "Ascent", Rising)
    monkeypatch.setattr(choices._Search, "_pick", pick)
    search._ascend()
    assert len(rounds) == 2 * (helped + 1)
    assert search.ascended.tolist() == [[2.0 * helped + 2.0] * 2, [2.0 * helped + 3.0] * 2]


def test_without_a_search_the_bound_is_the_largest_of_all_multipliers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Over a grid of both; a factor for those of the best allocation alone leaves 5 percent."""
    own, limit = rough_or_fine(2, seed=3), np.array([1.5, 1.2])
    first, second = np.meshgrid(np.linspace(0.0, 4.0, 161), np.linspace(0.0, 4.0, 161))
    dual = -first * limit[0] - second * limit[1]
    for feature in own.features:
        each = []
        for one in feature.ways:
            price = first * one.linear[0] + second * one.linear[1]
            b = one.curve.b  # type: ignore[attr-defined]
            t = np.clip(np.sqrt(b / np.maximum(price, 1e-9)), one.low, one.high)
            each.append(one.curve.cost(t) + price * t)
        dual += np.min(each, axis=0)
    monkeypatch.setattr(choices, "LEAVES", 0)
    found = least_cost(own, limit[None, :])
    assert 0.999 * dual.max() <= found.bound[0] <= dual.max() * 1.001
    assert found.cost[0] == pytest.approx(by_hand(own, limit.tolist()), rel=1e-7)


def test_limits_without_multipliers_begin_with_the_middle_of_the_others() -> None:
    search = begun(form(SQUARES), [0.5], [0.005], [0.25])
    np.testing.assert_allclose(search._scaled_multipliers()[:, 0], [4.0, 10.0, 16.0], rtol=1e-6)


@pytest.mark.parametrize("unit", [1.0, 1e-6, 1e6])
def test_first_multipliers_have_the_units_of_cost_and_limits(unit: float) -> None:
    """From 1/9 to 100 + 5; of limits that are 0 or missing everywhere they are finite."""
    search = choices._Search(form(SQUARES), unit * np.array([[0.5], [-2.0]]))
    dearest = 105.0 - 1.0 / 9.0
    np.testing.assert_allclose(search._scaled_multipliers() * unit, dearest / 2.0, rtol=1e-12)
    none = choices._Search(rough_or_fine(2), np.array([[0.0, INF]]))
    assert np.all(np.isfinite(none._scaled_multipliers()))
