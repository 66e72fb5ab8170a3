"""Guards of the search by prices of squares: what has no price, what is solved, when it ends.

Parts cost a + b/t, and a requirement is the root of the sum of (a_j t_j)^2.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.algorithms.exact.parts_by_hand import INF, Array, form, unused, way
from tolevo.algorithms.exact import separable
from tolevo.algorithms.exact.separable import Leaf, Squares, least_leaf
from tolevo.models.costs import Reciprocal, ReciprocalPower
from tolevo.problems.forms import Feature, Form, Way


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, ...]]:
    """The choices of ways that are solved, in their order."""
    chosen: list[tuple[int, ...]] = []
    real = Squares.solve

    def noted(squares: Squares, ways: tuple[int, ...], *given: Any) -> Leaf:
        chosen.append(ways)
        return real(squares, ways, *given)

    monkeypatch.setattr(Squares, "solve", noted)
    return chosen


@pytest.fixture
def priced(monkeypatch: pytest.MonkeyPatch) -> list[Array]:
    """The prices of squares (features,) at which tolerances are asked for, in their order."""
    asked: list[Array] = []
    real = separable._Choice.best

    def noted(choice: separable._Choice, q: Array) -> tuple[Array, Array]:
        asked.append(q)
        return real(choice, q)

    monkeypatch.setattr(separable._Choice, "best", noted)
    return asked


# -------------------------------------------------------------------- one choice of ways


def test_tolerances_and_their_derivatives_by_the_logarithm_of_a_price() -> None:
    """n b/t^k + q t^2 is least at t^(k + 2) = n k b/(2 q), which falls by t/(k + 2) per unit of
    ln q; at an end of its range a tolerance does not move.
    """
    counts, powers, b = np.array([1.0, 2.0, 1.0, 3.0]), (1.0, 1.0, 1.7, 0.6), 0.3
    features = tuple(
        Feature(f"t{at}", (Way(Reciprocal(1.0, b) if k == 1.0 else ReciprocalPower(1.0, b, k),
                               0.2, 1.5, (0.0,), (1.0,)),), count=int(count))
        for at, (count, k) in enumerate(zip(counts, powers, strict=True))
    )  # fmt: skip
    own = Form(("v",), features, np.zeros(1), np.zeros(1), "")
    choice = separable._Choice(Squares(own), (0,) * 4)
    k = np.array(powers)
    for q, inside in ((1e-3, False), (0.5, True), (2.0, True), (1e4, False)):
        free = (counts * k * b / (2.0 * q)) ** (1.0 / (k + 2.0))
        assert np.all(((free > 0.21) & (free < 1.49)) == inside)
        t, slope = choice.best(np.full(4, q))
        np.testing.assert_allclose(t, np.clip(free, 0.2, 1.5), rtol=1e-12)
        np.testing.assert_allclose(slope, -free / (k + 2.0) if inside else 0.0, rtol=1e-5)


def test_what_the_widest_keep_asks_for_no_prices(monkeypatch: pytest.MonkeyPatch) -> None:
    """1/2 + 1/4 at t = 2 and 4, under |t| <= 4.5 and 2 t1 <= 4."""
    monkeypatch.setattr(separable._Choice, "_newton", unused)
    own = form([way(0.0, 1.0, 0.1, 2.0, (0.0, 0.0), (1.0, 2.0))],
               [way(0.0, 1.0, 0.1, 4.0, (0.0, 0.0), (1.0, 0.0))])  # fmt: skip
    leaf = Squares(own).solve((0, 0), np.array([4.5**2, 4.0**2]), None)
    assert leaf.cost == leaf.bound == pytest.approx(0.75, rel=1e-15)
    assert leaf.t.tolist() == [2.0, 4.0] and leaf.mu.tolist() == [0.0, 0.0]


def test_no_bound_is_above_the_cost_where_the_tightest_break_a_limit_by_rounding() -> None:
    """t >= 0.5 under t^2 <= 0.25 (1 - 8e-13), which counts as kept: no price is high enough."""
    own = form([way(0.0, 1.0, 0.5, 2.0, (0.0,), (1.0,))])
    leaf = Squares(own).solve((0,), np.array([0.25 * (1.0 - 8e-13)]), None)
    assert leaf.t[0] == 0.5
    assert leaf.bound <= leaf.cost == 2.0


def test_a_part_of_no_requirement_is_as_wide_as_it_may_be(monkeypatch: pytest.MonkeyPatch) -> None:
    """1/t1 + 1/t2 under t1 <= 0.5 alone: Newton's method has no price for t2 <= 5."""
    monkeypatch.setattr(separable._Choice, "_ascended", unused)
    own = form([way(0.0, 1.0, 0.01, 5.0, (0.0,), (1.0,))],
               [way(0.0, 1.0, 0.01, 5.0, (0.0,), (0.0,))])  # fmt: skip
    leaf = Squares(own).solve((0, 0), np.array([0.25]), None)
    assert leaf.cost == pytest.approx(2.2, rel=1e-12)
    assert leaf.bound == pytest.approx(2.2, rel=1e-12)
    np.testing.assert_allclose(leaf.t, [0.5, 5.0], rtol=1e-12)


@pytest.mark.parametrize("room", [0.0, 0.09, INF])
def test_a_requirement_that_no_tolerance_moves_has_no_price(monkeypatch: pytest.MonkeyPatch, room: float) -> None:
    """1/t under t <= 0.5, beside a constant with a limit that leaves it this room, or none."""
    own = form([way(0.0, 1.0, 0.01, 5.0, (0.0, 0.0), (1.0, 0.0))])
    for better in (separable._Choice._ascended, unused):
        monkeypatch.setattr(separable._Choice, "_ascended", better)
        leaf = Squares(own).solve((0,), np.array([0.25, room]), None)
        assert leaf.cost == pytest.approx(2.0, rel=1e-12)
        assert leaf.bound == pytest.approx(2.0, rel=1e-12)
        np.testing.assert_allclose(leaf.mu, [4.0, 0.0], rtol=1e-9)


def test_a_way_whose_requirement_no_tolerance_moves_is_one_of_the_choices() -> None:
    """1/t under t <= 0.5 and t <= 0.4, or 0.1 + 1/t without the second one: 2.1 against 2.5."""
    own = form([way(0.0, 1.0, 0.01, 5.0, (0.0, 0.0), (1.0, 1.0)),
                way(0.1, 1.0, 0.02, 5.0, (0.0, 0.0), (1.0, 0.0))])  # fmt: skip
    best, bound = least_leaf(Squares(own), np.array([0.5, 0.4]), None)
    assert best.ways == (1,)
    assert best.cost == pytest.approx(2.1, rel=1e-12)
    assert bound == pytest.approx(2.1, rel=1e-12)


def test_newton_ends_as_soon_as_what_binds_is_met(priced: list[Array]) -> None:
    """t <= 0.6 and t <= 0.5: the first price is given up for good, the second one is 4 after some
    eight steps by a factor of e^3 and a few more, each of which squares what is missed.
    """
    own = form([way(0.0, 1.0, 0.01, 5.0, (0.0, 0.0), (1.0, 1.0))])
    choice = separable._Choice(Squares(own), (0,))
    mu = choice._newton(np.array([0.36, 0.25]), np.ones(2, dtype=bool), None)
    assert mu[0] == 0.0 and mu[1] == pytest.approx(4.0, rel=1e-12)
    assert len(priced) <= separable.STEPS // 2


def test_newton_has_nothing_left_to_do_at_the_right_price(priced: list[Array]) -> None:
    """1/t under t <= 0.5 has the price 4."""
    own = form([way(0.0, 1.0, 0.01, 5.0, (0.0,), (1.0,))])
    choice = separable._Choice(Squares(own), (0,))
    mu = choice._newton(np.array([0.25]), np.ones(1, dtype=bool), np.array([4.0]))
    assert mu[0] == pytest.approx(4.0, rel=1e-12)
    assert len(priced) <= 2


def test_a_search_begins_at_the_prices_that_are_known(priced: list[Array]) -> None:
    """The first price of the tightest ways is that of the leaf that is known, be it of other ways:
    8, that of t <= 0.5 for 2/t.
    """
    ways = [way(0.0, b, low, 5.0, (0.0,), (1.0,)) for b, low in ((2.0, 0.02), (1.0, 0.01))]
    known = Leaf((0,), np.array([0.5]), 4.0, 4.0, np.array([8.0]))
    best, _ = least_leaf(Squares(form(ways)), np.array([0.5]), known)
    assert best.cost == pytest.approx(2.0, rel=1e-12)
    np.testing.assert_allclose(priced[0], [8.0], rtol=1e-12)


def test_only_what_is_in_a_broken_limit_is_drawn_in() -> None:
    """Parts at 0.6 and 0.7, each in a limit of its own, 0.5 and 0.9, and one in none."""
    rows = ((1.0, 0.0), (0.0, 1.0), (0.0, 0.0))
    own = form(*[[way(0.0, 1.0, 0.1, 2.0, (0.0, 0.0), row)] for row in rows])
    choice = separable._Choice(Squares(own), (0, 0, 0))
    kept = choice._moved_within_room(np.array([0.6, 0.7, 1.5]), np.array([0.25, 0.81]))
    assert kept[0] <= 0.5 and kept[0] == pytest.approx(0.5, rel=1e-12)
    assert kept[1:].tolist() == [0.7, 1.5]


# -------------------------------------------------------------------- which choices are solved


def wide_or_tight(parts: int) -> Form:
    """1/t each, or 20/t with a tighter range: of no use where the first one reaches."""
    ways = [way(0.0, b, low, 5.0, (0.0,), (1.0,)) for b, low in ((1.0, 0.1), (20.0, 0.05))]
    return form(*[ways] * parts)


@pytest.mark.parametrize("parts", [3, 5])
def test_prices_choose_the_best_ways_of_all_parts_at_once(
    monkeypatch: pytest.MonkeyPatch, solved: list[tuple[int, ...]], parts: int
) -> None:
    """All alike under |t| <= 2: n^1.5/2. Besides the tightest ways, which the search begins with,
    only these are solved of all 2^n: their prices exclude what the first ones, 20 times as high,
    would not.
    """
    for most in (400, 2):
        monkeypatch.setattr(separable, "LEAVES", most)
        solved.clear()
        best, bound = least_leaf(Squares(wide_or_tight(parts)), np.array([2.0]), None)
        assert best.cost == pytest.approx(parts**1.5 / 2.0, rel=1e-12)
        assert bound == pytest.approx(best.cost, rel=1e-11)
        assert solved == [(1,) * parts, (0,) * parts]


@pytest.mark.parametrize("known", [None, (0, 0, 0), (1, 1, 1), (0, 1, 0)])
@pytest.mark.parametrize("limit", [0.14, 0.18, 0.3])
def test_no_choice_is_solved_twice(solved: list[tuple[int, ...]], limit: float, known: tuple[int, ...] | None) -> None:
    """Parts of unlike b in a wide way or a tight one, which some limits ask for and some do not."""
    ways = [[way(0.0, b, 0.1, 5.0, (0.0,), (1.0,)), way(2.0, b, 0.05, 5.0, (0.0,), (0.5,))]
            for b in (0.2, 0.5, 1.0)]  # fmt: skip
    squares, first = Squares(form(*ways)), None
    if known is not None:
        first = Leaf(known, np.full(3, 0.1), INF, INF, np.ones(1))
    best, _ = least_leaf(squares, np.array([limit]), first)
    assert len(solved) == len(set(solved)) and best.ways in solved


def test_known_ways_count_where_the_tightest_keep_no_limit() -> None:
    """The part of least t breaks 0.5 by its spread of 10; the other one costs 1/0.5."""
    own = form([way(0.0, 1.0, 0.1, 1.0, (0.0,), (10.0,)), way(0.0, 1.0, 0.2, 1.0, (0.0,), (1.0,))])
    known = Leaf((1,), np.array([0.2]), 5.0, 0.0, np.zeros(1))
    best, bound = least_leaf(Squares(own), np.array([0.5]), known)
    assert best.ways == (1,)
    assert best.cost == pytest.approx(2.0, rel=1e-12)
    assert bound == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize("most", [1, 4, 400])
def test_no_more_choices_are_solved_than_are_allowed(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """Of 2^3, from a leaf without a price, whose bound is the cost 3 times 20/5 of the widest. The
    least cost is 3^1.5/0.4, and no bound is above it.
    """
    monkeypatch.setattr(separable, "LEAVES", most)
    anchor = Leaf((1, 1, 1), np.full(3, 0.05), INF, 12.0, np.zeros(1))
    leaves = {anchor.ways: anchor}
    best, bound = separable._search_remaining_choices(Squares(wide_or_tight(3)), np.array([0.4**2]), anchor, leaves)
    assert len(leaves) == min(most, 8)
    least = 3.0**1.5 / 0.4
    assert bound <= least * (1.0 + 1e-12)
    if most == 400:
        assert best.cost == pytest.approx(least, rel=1e-12)
