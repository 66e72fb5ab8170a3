"""Nodes of the master problem by hand: few ways, sums and roots, linear programmes that fail."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy

from tolevo.algorithms.exact import choices as master
from tolevo.algorithms.exact.choices import GAP, Master, Solution, cost_range
from tolevo.algorithms.exact.combination import Combination
from tolevo.algorithms.exact.programme import Programme
from tolevo.models.costs import Reciprocal
from tolevo.problems.forms import Feature, Form, Spread, Way, spread_of
from tolevo.section import Array

INF = np.inf
Made = tuple[float, float, float, float, tuple[float, ...], tuple[float, ...]]
"""A way: a and b of its cost a + b/t, low, high, linear parts and spreads (r,)."""


def form_of(*features: list[Made], base: float = 0.0) -> Form:
    rows = len(features[0][0][4])
    made = tuple(
        Feature(f"t{at}", tuple(Way(Reciprocal(a, b), low, high, linear, spread)
                                for a, b, low, high, linear, spread in ways), f"p{at}")
        for at, ways in enumerate(features)
    )  # fmt: skip
    return Form(tuple("vw"[:rows]), made, np.zeros(rows), np.zeros(rows), "", base)


def points(*features: list[tuple[float, float]], root: bool = False) -> Form:
    """Ways of a price and a part s at t = 1; the value is the sum of the parts, or their root."""
    made: list[list[Made]] = [
        [(price, 0.0, 1.0, 1.0, (0.0 if root else s,), (s if root else 0.0,)) for price, s in ways] for ways in features
    ]
    return form_of(*made)


def some_points(seed: int, root: bool = False) -> Form:
    """Four features in three ways each: the dearer the way, the smaller its part."""
    rng = np.random.default_rng(seed)
    price, s = np.sort(rng.uniform(1.0, 3.0, (2, 4, 3)))
    return points(*(list(zip(p, r[::-1], strict=True)) for p, r in zip(
        price.tolist(), s.tolist(), strict=True)), root=root)  # fmt: skip


def some_ranges(rows: int = 1, seed: int = 4) -> Form:
    """Two features in two ways each, to be searched under roots."""
    rng = np.random.default_rng(seed)

    def way() -> Made:
        a, b = rng.uniform(0.0, 1.0), rng.uniform(0.5, 2.0)
        return a, b, 0.2, 3.0, (0.0,) * rows, tuple(rng.uniform(0.5, 2.0, rows).tolist())

    return form_of([way(), way()], [way(), way()])


class Watched(Master):
    """Notes the linear programmes: what their mean costs, bounds, and whether cuts were added."""

    def __post_init__(self) -> None:
        self.totals: list[float] = []
        self.bounds: list[float] = []
        self.cut: list[bool] = []
        self.nodes = 0
        super().__post_init__()

    def _node(self, *given: Any) -> tuple[float, list[Array] | None]:
        self.nodes += 1
        return super()._node(*given)

    def _programme(self, open_: Any) -> tuple[list[int], Array, Array]:
        used, x, prices = super()._programme(open_)
        cost = np.array([self._columns[i][3] for i in used])
        self.totals.append(self.form.base + float(cost @ x))
        return used, x, prices

    def _lagrangian(self, *given: Any) -> tuple[float, Array]:
        bound, t = super()._lagrangian(*given)
        self.bounds.append(bound)
        return bound, t

    def _add_cuts(self, *given: Any) -> bool:
        self.cut.append(super()._add_cuts(*given))
        return self.cut[-1]


def begun(form: Form, limit: float | Array) -> Watched:
    limits = np.broadcast_to(limit, len(form.outputs)).astype(float)
    return Watched(form, limits, *cost_range(form))


def every(form: Form) -> tuple[tuple[int, ...], ...]:
    return tuple(tuple(range(len(feature.ways))) for feature in form.features)


def by_hand(form: Form, limit: float) -> float:
    """The least cost of points under one limit, by looking at all choices."""
    found = INF
    for ways in product(*(feature.ways for feature in form.features)):
        price = form.base + sum(float(way.curve.cost(np.ones(1))[0]) for way in ways)
        value = sum(way.linear[0] for way in ways) + sum(way.spread[0] ** 2 for way in ways) ** 0.5
        found = min(found, price) if value <= limit else found
    return found


# ------------------------------------------------------------------------------ whole searches


@pytest.mark.parametrize("root", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_the_cheapest_of_81_choices(monkeypatch: pytest.MonkeyPatch, seed: int, root: bool) -> None:
    """No choice is solved twice, and no column is there twice."""
    monkeypatch.setattr(master, "NODES", 500)
    form, solved = some_points(seed, root), []
    kept = Programme.kept_allocation

    def noted(own: Programme, limit: Array, start: Array) -> Array | None:
        solved.append(own.combination.chosen)
        return kept(own, limit, start)

    monkeypatch.setattr(Programme, "kept_allocation", noted)
    for limit in (3.9, 4.2) if root else (7.4, 8.1):
        solved.clear()
        own = begun(form, limit)
        best, least = own.run(), by_hand(form, limit)
        if best is None:
            assert least == own.proven == INF
        else:
            assert least * (1.0 - 1e-14) <= best.cost <= least / (1.0 - GAP)  # rounding of sums
            assert best.cost * (1.0 - 2.0 * GAP) <= best.bound <= least * (1.0 + 1e-12)
        assert len(set(solved)) == len(solved)
        assert len({(at, way) for at, way, _, _ in own._columns}) == len(own._columns) == 12


def test_one_node_says_that_nothing_keeps_the_limits() -> None:
    """The least root is 0.2 of the parts at t = 1: of less no set of ways need be solved."""
    own = begun(some_ranges(), 0.05)
    assert own.run() is None
    assert own.proven == INF
    assert own.nodes == 1
    assert not own._solved


def test_a_way_that_fits_is_found_among_ways_of_one_price() -> None:
    """Floor and ceiling are the same; breaking a limit still has a price."""
    form = points([(1.0, 3.0), (1.0, 1.0)], [(1.0, 3.0), (1.0, 1.0), (1.0, 2.0)])
    best = begun(form, 2.5).run()
    assert best is not None
    assert best.chosen == (1, 1)
    assert best.cost == 2.0
    assert best.bound == pytest.approx(2.0)


def test_a_limit_of_nothing() -> None:
    """t2 - t1 <= 0, t1 up to 2, t2 up to 3, both cost 1/t: both are 2."""
    form = form_of([(0.0, 1.0, 1.0, 2.0, (-1.0,), (0.0,))], [(0.0, 1.0, 1.0, 3.0, (1.0,), (0.0,))])
    own = begun(form, 0.0)
    best = own.run()
    assert best is not None
    assert best.cost == pytest.approx(1.0, rel=GAP)
    assert 1.0 - GAP <= best.bound <= 1.0


# ------------------------------------------------------------------------------ nodes


def test_first_cuts_touch_at_each_features_own_parts() -> None:
    """Of one way each the root is linear there: one linear programme, no further cut."""
    own = begun(points([(1.0, 3.0)], [(2.0, 4.0)], root=True), 5.1)
    bound, _ = own._node(((0,), (0,)), -INF)
    assert bound == pytest.approx(3.0)
    assert len(own.bounds) == 1
    for _, direction, intercept in own._cuts:
        np.testing.assert_allclose(direction, [0.6, 0.8])
        assert intercept == pytest.approx(0.0, abs=1e-12)


def test_no_cut_where_limits_are_kept() -> None:
    own = begun(some_ranges(), 100.0)
    before = len(own._cuts)
    bound, weight = own._node(every(own.form), -INF)
    assert weight is not None
    assert len(own._cuts) == before
    assert len(own.bounds) == 1
    assert bound == pytest.approx(own.floor)


@pytest.mark.parametrize("form", [some_ranges(), some_ranges(2), some_points(0, True)])
def test_a_node_is_left_once_it_is_solved_and_not_before(form: Form) -> None:
    """Nothing is gained where it is entered again; all rounds but the last left something."""
    own = begun(form, 2.5 if len(form.features) == 2 else 3.9)
    bound, weight = own._node(every(form), -INF)
    assert weight is not None
    first = len(own.bounds)
    cut = own.cut[-first:]
    best = np.maximum.accumulate(own.bounds)
    done = [not more and total - low <= 0.1 * GAP * total
            for more, total, low in zip(cut, own.totals, best, strict=True)]  # fmt: skip
    assert done == [False] * (first - 1) + [True]
    again, _ = own._node(every(form), -INF)
    assert again == pytest.approx(bound, rel=0.1 * GAP)


def test_only_open_ways_are_mixed() -> None:
    """The dearer way alone: its own least cost, by bisection of the root."""
    form = form_of([(1.0, 1.0, 0.2, 3.0, (0.0,), (1.0,)), (0.0, 1.0, 0.2, 3.0, (0.0,), (1.0,))],
                   [(0.0, 1.0, 0.2, 3.0, (0.0,), (1.0,))])  # fmt: skip
    own = begun(form, np.sqrt(2.0))  # both at t = 1
    bound, weight = own._node(((0,), (0,)), -INF)
    assert weight is not None
    np.testing.assert_allclose(np.concatenate(weight), [1.0, 0.0, 1.0], atol=1e-9)
    assert 3.0 * (1.0 - GAP) <= bound <= 3.0
    assert own._node(((0, 1), (0,)), -INF)[0] <= 2.0


def test_a_node_keeps_what_is_proven_already(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(master, "MASTER_ROUNDS", 1)
    own = begun(some_ranges(), 2.0)
    rough, _ = own._node(every(own.form), -INF)
    given = rough + 0.25 * (own.ceiling - rough)
    assert begun(own.form, 2.0)._node(every(own.form), given)[0] == given


def test_a_node_is_left_where_it_cannot_be_cheaper() -> None:
    """After the first bound that is as high as the best cost, without weights."""
    own = begun(some_ranges(), 2.5)
    own.best = Solution((0, 0), np.ones(2), own.floor, -INF)
    bound, weight = own._node(every(own.form), -INF)
    assert weight is None
    assert bound == max(own.bounds)
    assert [low >= own.floor * (1.0 - GAP) for low in own.bounds] == [False, True]


def test_prices_of_one_requirement_are_not_paid_for_another() -> None:
    """Random prices of the cuts of two roots, against allocations drawn at random."""
    form, rng = some_ranges(2), np.random.default_rng(0)
    own = begun(form, 2.0)
    own.run()
    t, kept = rng.uniform(0.2, 3.0, (4000, 2)), []
    for chosen in product((0, 1), repeat=2):
        one = Combination(form, chosen)
        kept.append(one.cost(t[np.all(one.values(t) <= 2.0, axis=1)]).min())
    for row in (0, 1, None):
        which = own._cut_arrays()[0]
        for _ in range(50):
            prices = rng.exponential(0.5, len(which)) * (True if row is None else which == row)
            prices *= rng.uniform(0.0, 2.0) / prices.sum()
            assert own._lagrangian(prices, np.ones(4, dtype=bool))[0] <= min(kept)


# ------------------------------------------------------------------------------ allocations


def test_the_tightest_of_what_is_mixed_is_tried_until_something_is_known() -> None:
    """Never a way without weight, though it is tighter."""
    form = form_of([(0.0, 1.0, low, 3.0, (0.0,), (1.0,)) for low in (0.3, 0.2, 0.1)])
    weight = [np.array([0.6, 0.4, 0.0])]
    own = begun(form, 2.0)
    own._round(weight, every(form), np.ones(1))
    assert own._solved == {(0,), (1,)}
    own = begun(form, 2.0)
    own.best = Solution((2,), np.ones(1), 0.4, -INF)
    own._round(weight, every(form), np.ones(1))
    assert own._solved == {(0,)}


def test_the_cheapest_allocation_stays() -> None:
    own = begun(points([(2.0, 1.0), (1.0, 1.0), (3.0, 1.0)]), 1.0)
    costs = []
    for way in (0, 1, 2):
        own._leaf((way,), np.ones(1))
        assert own.best is not None
        costs.append(own.best.cost)
    assert costs == [2.0, 1.0, 1.0]


# ------------------------------------------------------------------------------ what may go wrong


def test_where_every_linear_programme_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search branches still: no bound but the floor, and of six choices the cheapest."""
    form = points([(1.0, 3.0), (2.0, 1.0)], [(1.0, 3.0), (3.0, 1.0), (2.0, 2.0)], [(1.0, 0.0)])
    monkeypatch.setattr(scipy.optimize, "linprog", lambda *_, **__: SimpleNamespace(x=None))
    own = begun(form, 3.0)
    best = own.run()
    assert best is not None
    assert best.cost == by_hand(form, 3.0) == 5.0
    assert best.bound == pytest.approx(own.floor)
    assert own.nodes <= 11


def stubbed(monkeypatch: pytest.MonkeyPatch, of: Any) -> None:
    """Linear programmes whose marginals are `of` the true ones."""
    real = scipy.optimize.linprog

    def found(*given: Any, **named: Any) -> Any:
        true = real(*given, **named)
        return SimpleNamespace(x=true.x, ineqlin=SimpleNamespace(
            marginals=of(np.asarray(true.ineqlin.marginals))))  # fmt: skip

    monkeypatch.setattr(scipy.optimize, "linprog", found)


def test_marginals_of_the_wrong_sign_prove_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """A limit that is far away must not be worth anything."""
    stubbed(monkeypatch, np.ones_like)
    own = begun(some_points(0), 20.0)
    bound, _ = own._node(every(own.form), -INF)
    assert bound == pytest.approx(own.floor)
    assert by_hand(own.form, 20.0) == pytest.approx(own.floor)


def test_a_node_without_a_price_ends_where_nothing_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Points have all their columns and sums all their cuts: one round, whatever the gap."""
    stubbed(monkeypatch, np.zeros_like)
    own = begun(some_points(0), 7.4)
    bound, _ = own._node(every(own.form), -INF)
    assert bound == pytest.approx(own.floor)
    assert own.totals[0] > 1.01 * own.floor
    assert len(own.totals) == 1


def test_a_tangent_without_a_known_error_is_no_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    def doubted(*given: Any) -> Spread:
        true = spread_of(*given)
        true.intercept[:, 1] = -INF
        return true

    form = some_ranges(2)
    full = begun(form, 2.0).run()
    monkeypatch.setattr(master, "spread_of", doubted)
    own = begun(form, 2.0)
    best = own.run()
    assert full is not None and best is not None
    assert {row for row, _, _ in own._cuts} == {0}
    assert best.bound <= full.cost
    assert full.bound <= best.cost
