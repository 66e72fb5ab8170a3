"""The dual of choices at its best multipliers: by hand, by differences, and over a grid."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tolevo.algorithms.exact.combination import Ascent
from tolevo.models.costs import Reciprocal
from tolevo.problems.forms import Feature, Form, Way, spread_of

INF = np.inf


def form_of(linear: tuple[float, ...], spread: tuple[float, ...], offset: tuple[float, ...] = ()) -> Form:
    """One part of b/t with b = 1 or, for 1 more, 0.25, and 0.1 in every requirement."""
    ways = tuple(Way(Reciprocal(a, b), 0.01, 9.0, linear, spread, offset, a)
                 for a, b in ((0.0, 1.0), (1.0, 0.25)))  # fmt: skip
    rows = len(linear)
    names = tuple(f"v{row}" for row in range(rows))
    return Form(names, (Feature("t", ways, "p"),), np.full(rows, 0.1), np.zeros(rows), "")


def ascent(form: Form, limit: list[float], t: float = 0.5) -> Ascent:
    spread = np.array(form.features[0].ways[0].spread)
    return Ascent(form, np.array(limit), spread_of(form, t * spread[None, :, None]))


def least(price: np.ndarray, form: Form, limit: list[float]) -> float:
    """Of sums alone: the least of a + b/t + l t over both ways, less what the limits receive."""
    way = form.features[0].ways[0]
    asked = np.isfinite(limit)
    own = float(price[asked] @ np.array(way.linear)[asked])
    moved = float(price[asked] @ np.array(way.offset)[asked]) if way.offset else 0.0
    received = float(price[asked] @ (np.array(limit)[asked] - 0.1))
    t = np.minimum(np.sqrt(np.array([1.0, 0.25]) / max(own, 1e-12)), 9.0)
    return float(np.min(np.array([0.0, 1.0]) + np.array([1.0, 0.25]) / t + own * t)) + moved - received


@pytest.mark.parametrize("offset", [(), (0.05, 0.02)])
@pytest.mark.parametrize("limit", [[0.4, 0.6], [0.4, INF], [INF, 0.9]])
def test_the_best_multipliers_of_sums(offset: tuple[float, ...], limit: list[float]) -> None:
    """Against 3,400 pairs of them, from near and from far."""
    form = form_of((1.0, 1.3), (0.0, 0.0), offset)
    own = ascent(form, limit)
    grid = np.concatenate([[0.0], np.geomspace(1e-3, 30.0, 99)])
    best = max(least(np.array([one, other]), form, limit) for one in grid[::3] for other in grid)
    for first in ([2.0, 1.0], [0.0, 20.0], [0.01, 0.0]):
        start = np.array(first)
        found = own.multipliers(start)
        value, _ = own.value(found)
        assert np.all(found >= 0.0)
        assert value == pytest.approx(least(found, form, limit), rel=1e-9)
        assert value >= best * (1.0 - 1e-6)


@pytest.mark.parametrize("offset", [(), (0.05, 0.02)])
def test_values_and_slopes_of_sums(offset: tuple[float, ...]) -> None:
    form, limit = form_of((1.0, 1.3), (0.0, 0.0), offset), [0.4, INF]
    own = ascent(form, limit)
    for price in (0.3, 3.0):
        each = np.array([price, 0.7])
        value, slope = own.value(each)
        assert value == pytest.approx(least(each, form, limit), rel=1e-9)
        step = np.array([1e-6, 0.0])
        by_differences = (least(each + step, form, limit) - least(each - step, form, limit)) / 2e-6
        np.testing.assert_allclose(slope, [by_differences, 0.0], rtol=1e-6)


def test_values_and_slopes_of_a_root() -> None:
    """Its square is priced: l / (2 S) of t^2 against (L - 0.1)^2, S = 0.5 at the reference."""
    form = form_of((0.0,), (1.0,))
    for limit in (0.4, 0.05):
        own, room = ascent(form, [limit]), max(limit - 0.1, 0.0)

        def by_hand(price: float, room: float = room) -> float:
            each = [a + 1.5 * (2.0 * price * b**2) ** (1.0 / 3.0) for a, b in ((0, 1), (1, 0.25))]
            return float(min(each) - price * room**2)

        for price in (0.5, 8.0):
            value, slope = own.value(np.array([price]))
            assert value == pytest.approx(by_hand(price), rel=1e-9)
            by_differences = (by_hand(price + 1e-6) - by_hand(price - 1e-6)) / 2e-6
            assert slope[0] == pytest.approx(by_differences, rel=1e-5)


@pytest.mark.parametrize(("spread", "t"), [(0.0, 0.5), (1.0, 0.0)])
def test_a_root_of_nothing_is_priced_itself(spread: float, t: float) -> None:
    """S = 0 at the reference: t is free there, and dual and slope are those of the offset."""
    with np.errstate(all="raise"):
        value, slope = ascent(form_of((0.0,), (spread,)), [0.4], t).value(np.array([2.0]))
    assert value == pytest.approx(1.0 / 9.0 - 2.0 * 0.3)
    assert slope[0] == pytest.approx(-0.3)


def test_from_nothing_it_is_no_worse() -> None:
    """Of a part that is free as well, whose bound is 0."""
    own, nothing = ascent(form_of((1.0,), (0.0,)), [0.6]), np.zeros(1)
    assert own.value(own.multipliers(nothing))[0] >= 1.0 / 9.0 * (1.0 - 1e-12)
    free = Way(Reciprocal(0.0, 0.0), 0.01, 9.0, (1.0,), (0.0,))
    form = Form(("v",), (Feature("t", (free,)),), np.zeros(1), np.zeros(1), "")
    assert ascent(form, [0.6]).multipliers(nothing) == [0.0]


@pytest.mark.parametrize("ends", [-0.5, 0.0, 1e6])
def test_worse_multipliers_are_not_taken(monkeypatch: pytest.MonkeyPatch, ends: float) -> None:
    own, first = ascent(form_of((1.0,), (0.0,)), [0.6]), np.array([1.0])

    def elsewhere(*_: Any, **__: Any) -> SimpleNamespace:
        return SimpleNamespace(x=np.array([ends]))

    monkeypatch.setattr("scipy.optimize.minimize", elsewhere)
    assert own.multipliers(first) == [1.0]


def test_multipliers_below_zero_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """A limit that the loosest tolerance keeps is worth nothing: 0 is best."""
    own = ascent(form_of((1.0,), (0.0,)), [60.0])

    def below(*_: Any, **__: Any) -> SimpleNamespace:
        return SimpleNamespace(x=np.array([-0.1]))

    monkeypatch.setattr("scipy.optimize.minimize", below)
    assert own.multipliers(np.array([1.0])) == [0.0]
