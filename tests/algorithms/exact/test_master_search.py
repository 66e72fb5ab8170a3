"""The branch and bound of the master problem over relaxations that are given, not solved.

Every choice of ways has a cost that is drawn; a node's relaxation is a table: a share of the least
cost of the choices that it allows, and weights of their ways. So what the search may conclude is
known by looking at all choices.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
import pytest

from tolevo.algorithms.exact import choices as master
from tolevo.algorithms.exact.choices import GAP, Allowed, Master, Solution
from tolevo.algorithms.exact.programme import Programme
from tolevo.models.costs import Reciprocal
from tolevo.problems.forms import Feature, Form, Way
from tolevo.section import Array

INF = np.inf


def points(*prices: Sequence[float], base: float = 0.0) -> Form:
    """Features made in ways of these prices, all at t = 1; the value is the sum of all t."""
    features = tuple(
        Feature(f"t{at}", tuple(Way(Reciprocal(price, 0.0), 1.0, 1.0, (1.0,), (0.0,))
                                for price in each), f"p{at}")
        for at, each in enumerate(prices)
    )  # fmt: skip
    return Form(("v",), features, np.zeros(1), np.zeros(1), "", base)


class Tabled(Master):
    """A search whose relaxations are `shares` of the least cost among the choices of a node."""

    def __init__(self, seed: int, ways: int = 3, parts: int = 3, exact: bool = False) -> None:
        """`exact`: a node is unmixed only where one choice is left, and is its cost then."""
        rng = np.random.default_rng(seed)
        super().__init__(points(*[[0.0] * ways] * parts), np.array([INF]), 0.5, 4.0)
        choices = list(product(range(ways), repeat=parts))
        cost = 1.0 + rng.integers(0, 3, len(choices)) + rng.integers(0, 5, len(choices)) * 0.3 * GAP
        cost[rng.uniform(size=len(choices)) < 0.3] = INF
        cost[rng.integers(len(choices))] = 2.0
        self.costs = dict(zip(choices, cost.tolist(), strict=True))
        self.rng, self.exact = rng, exact
        self.entered: list[Allowed] = []

    @property
    def least(self) -> float:
        return float(min(self.costs.values()))

    def _node(self, allowed: Allowed, bound: float) -> tuple[float, list[Array] | None]:
        assert not self._is_useless(bound)
        assert allowed not in self.entered
        assert all(allowed)
        self.entered.append(allowed)
        single = all(len(ways) == 1 for ways in allowed)
        least = min(self.costs[choice] for choice in product(*allowed))
        share = 1.0 if self.exact and single else self.rng.choice([0.4, 0.9, 1.0 - 0.5 * GAP, 1.0])
        bound = max(bound, float(share) * least)
        if self._is_useless(bound):
            return bound, None
        whole = not self.exact and self.rng.uniform() < 0.3
        weight = []
        for ways, feature in zip(allowed, self.form.features, strict=True):
            one = np.zeros(len(feature.ways))
            some = self.rng.exponential(1.0, len(ways))
            one[list(ways)] = some / some.sum()
            weight.append(np.round(one / one.max() - 0.4999) if whole else one)
        return bound, weight

    def _is_useless(self, bound: float) -> bool:
        """By hand: above all costs there are, or not below the best one by the gap."""
        best = INF if self.best is None else self.best.cost
        return bound > self.ceiling * (1.0 + GAP) or bound >= best * (1.0 - GAP)

    def _round(self, weight: list[Array], allowed: Allowed, start: Array) -> None:
        chosen = tuple(int(np.argmax(one)) for one in weight)
        cost = self.costs[chosen]
        if cost < (INF if self.best is None else self.best.cost):
            self.best = Solution(chosen, np.ones(len(chosen)), cost, -INF)


@pytest.mark.parametrize("nodes", [1, 2, 5, 1000])
def test_no_choice_is_below_what_the_search_proves(monkeypatch: pytest.MonkeyPatch, nodes: int) -> None:
    """However early it is stopped, and where relaxations without mixed ways leave gaps."""
    monkeypatch.setattr(master, "NODES", nodes)
    for seed in range(60):
        search = Tabled(seed)
        found = search.run()
        assert len(search.entered) <= nodes
        assert search.proven <= search.least
        if found is not None:
            assert found.cost == search.costs[found.chosen]
            assert search.floor <= found.bound <= search.least


def test_the_cheapest_choice_is_found_where_nothing_stops_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """The 27 choices in no more than the 53 nodes of a tree that ends in all of them."""
    monkeypatch.setattr(master, "NODES", 1000)
    for seed in range(60):
        search = Tabled(seed, exact=True)
        found = search.run()
        assert found is not None
        assert found.cost <= search.least / (1.0 - GAP)
        assert found.cost * (1.0 - GAP) * (1.0 - 1e-15) <= found.bound <= search.least
        assert len(search.entered) <= 53


def test_a_bound_is_never_above_its_cost_by_rounding() -> None:
    class Above(Master):
        def _node(self, allowed: Allowed, bound: float) -> tuple[float, list[Array] | None]:
            return float(np.nextafter(1.0, 2.0)), [np.ones(1)]

    found = Above(points([1.0]), np.array([INF]), 1.0, 1.0).run()
    assert found is not None
    assert found.cost == found.bound == 1.0


@pytest.mark.parametrize("base", [0.0, -10.0])
def test_only_what_costs_more_than_everything_is_impossible(monkeypatch: pytest.MonkeyPatch, base: float) -> None:
    """A base may be below zero: a cost of -9 is its own ceiling, and nothing lies above it."""
    form = points([1.0], base=base)
    own = Master(form, np.array([2.0]), base + 1.0, base + 1.0)
    found = own.run()
    assert found is not None
    assert found.cost == base + 1.0
    assert base + 1.0 - 1e-9 <= found.bound <= found.cost
    impossible = Master(form, np.array([0.9]), base + 1.0, base + 2.0)
    assert impossible.run() is None
    assert impossible.proven == INF
    monkeypatch.setattr(Programme, "kept_allocation", lambda *_: None)
    nothing = Master(form, np.array([2.0]), base + 1.0, base + 1.0)
    assert nothing.run() is None
    assert nothing.proven == pytest.approx(base + 1.0)  # proven is the least cost, no more
