"""Bounds between solved limits: the 90 % quantile of a uniform part is 0.8 t, so C = 1 + 0.8/L."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from tolevo.algorithms.exact import bounds as between
from tolevo.algorithms.exact.bounds import least_bounds
from tolevo.algorithms.exact.choices import least_cost
from tolevo.algorithms.exact.combination import Optimum
from tolevo.models.costs import Reciprocal
from tolevo.models.propagation.convolution import EvenPlateau
from tolevo.problems.forms import Feature, Form, Piece, Quantile, Way

QUANTILE = Quantile(0.9, ((Piece(1.0, EvenPlateau()),),))
LIMITS = np.concatenate([[0.05, 0.0799], np.linspace(0.0801, 1.2, 10), [3.0]])


def by_hand(limits: np.ndarray) -> np.ndarray:
    """One part from 0.1 to 1, made in two ways: 1 + 1/t, or 4 + 0.1/t from 0.02 on, t = L/0.8."""
    t = limits / 0.8
    rough = np.where(t < 0.1, np.inf, 1.0 + 1.0 / np.clip(t, 0.1, 1.0))
    fine = np.where(t < 0.1, np.inf, 4.0 + 0.1 / np.clip(t, 0.1, 1.0))
    return np.asarray(np.minimum(rough, fine))


def form_of(rows: int = 1) -> Form:
    curves, one = (Reciprocal(1.0, 1.0), Reciprocal(4.0, 0.1)), (1.0,) * rows
    ways = tuple(Way(curve, 0.1, 1.0, (0.0,) * rows, one) for curve in curves)
    nothing = np.zeros(rows)
    return Form(tuple("vw"[:rows]), (Feature("t", ways, "p"),), nothing, nothing, "",
                quantiles=(QUANTILE,) * rows)  # fmt: skip


@pytest.mark.parametrize(("first", "solved", "order"), [(4, 40, 1), (4, 6, -1), (2, 2, -1)])
def test_bounds_hold_everywhere_and_are_close_where_enough_is_solved(
    monkeypatch: pytest.MonkeyPatch, first: int, solved: int, order: int
) -> None:
    monkeypatch.setattr(between, "FIRST", first)
    monkeypatch.setattr(between, "SOLVED", solved)
    limits = LIMITS[::order]
    found, least = least_bounds(form_of(), limits[:, None]), by_hand(limits)
    real = np.isfinite(least)
    assert np.all(found[real] <= least[real] * (1.0 + 1e-9))
    assert np.all(found[~real] <= np.inf)
    if solved == 40:
        assert np.all(found[real] >= 0.9 * least[real]), found[real] / least[real]
        assert np.all(np.isinf(found[limits < 0.07]))
    assert np.all(found[real] >= 1.8 * (1.0 - 1e-9))  # t = 1 costs 2 or 4.1


def test_sets_of_two_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both are the same quantile: the tighter one counts."""
    monkeypatch.setattr(between, "FIRST", 4)
    rng = np.random.default_rng(0)
    limits = rng.uniform(0.09, 1.0, (8, 2))
    limits[3, 0], limits[4, 1] = np.inf, np.inf
    found, least = least_bounds(form_of(2), limits), by_hand(limits.min(axis=1))
    assert np.all(found <= least * (1.0 + 1e-9))
    assert np.all(found >= 0.7 * least)


def test_what_needs_no_neighbours_is_solved() -> None:
    """Roots are fast, and few limits too: the bounds are those of the solver itself."""
    way = Way(Reciprocal(1.0, 1.0), 0.1, 1.0, (0.0,), (1.0,))
    root = Form(("v",), (Feature("t", (way,)),), np.zeros(1), np.zeros(1), "")
    limits = np.linspace(0.11, 0.9, 30)[:, None]
    np.testing.assert_allclose(least_bounds(root, limits), 1.0 + 1.0 / limits[:, 0], rtol=1e-10)
    few = limits[:2]
    np.testing.assert_array_equal(least_bounds(form_of(), few), least_cost(form_of(), few).bound)


class Counted:
    """`least_cost`, and the rows of limits that it was asked for."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.asked: list[np.ndarray] = []
        monkeypatch.setattr(between, "least_cost", self)

    def __call__(self, form: Form, limits: np.ndarray) -> Optimum:
        self.asked.append(limits)
        return least_cost(form, limits)

    @property
    def rows(self) -> np.ndarray:
        return np.concatenate(self.asked)


def smooth(rows: int = 1) -> Form:
    """One part made in one way, 1 + 1/t from 0.02 to 1: the cost is 1 + 0.8/L."""
    way = Way(Reciprocal(1.0, 1.0), 0.02, 1.0, (0.0,) * rows, (1.0,) * rows)
    return Form(tuple("vw"[:rows]), (Feature("t", (way,)),), np.zeros(rows), np.zeros(rows), "",
                quantiles=(QUANTILE,) * rows)  # fmt: skip


@pytest.mark.parametrize("fixed", [(), (0.79,), (np.inf,)])
def test_along_one_limit_few_are_solved_and_no_bound_loses_much(
    monkeypatch: pytest.MonkeyPatch, fixed: tuple[float, ...]
) -> None:
    """Whatever the other limit is, as long as it stays the same."""
    counted, moving = Counted(monkeypatch), np.linspace(0.3, 0.79, 200)
    limits = np.column_stack([moving, *(np.full(200, one) for one in fixed)])
    found, least = least_bounds(smooth(limits.shape[1]), limits), 1.0 + 0.8 / moving
    assert np.all(found <= least)
    assert np.all(found >= least * (1.0 - between.LOST))
    assert between.FIRST < len(counted.rows) < between.SOLVED - 8


def test_where_neighbours_tell_enough_nothing_more_is_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    counted = Counted(monkeypatch)
    least_bounds(smooth(), np.linspace(0.5, 0.52, 200)[:, None])
    assert len(counted.rows) == between.FIRST


def test_no_more_are_solved_than_are_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside a jump from one way to another no number of neighbours is enough."""
    counted = Counted(monkeypatch)
    monkeypatch.setattr(between, "SOLVED", 17)
    least_bounds(form_of(), np.linspace(0.09, 0.79, 60)[:, None])
    assert len(counted.rows) == between.SOLVED


def test_roots_are_solved_at_every_limit() -> None:
    way = Way(Reciprocal(1.0, 1.0), 0.1, 1.0, (0.0,), (1.0,))
    root = Form(("v",), (Feature("t", (way,)),), np.zeros(1), np.zeros(1), "")
    limits = np.linspace(0.11, 0.9, 300)
    np.testing.assert_allclose(least_bounds(root, limits[:, None]), 1.0 + 1.0 / limits, rtol=1e-11)


def test_what_wider_limits_show_to_be_impossible_is_not_solved_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The widest solved limit that cannot be kept decides for all that are tighter."""
    counted = Counted(monkeypatch)
    limits = np.concatenate([np.linspace(0.001, 0.07, 100), np.linspace(0.3, 0.79, 100)])
    found = least_bounds(smooth(), limits[:, None])
    kept = limits >= 0.8 * 0.02
    assert np.all(np.isfinite(found[kept]))
    assert np.sum(np.isinf(found[~kept])) >= 10  # the others are beside the first that can be kept
    assert np.sum(counted.rows < 0.016) <= 6


@pytest.mark.parametrize("seed", range(3))
def test_no_bound_is_below_one_of_wider_limits_that_were_solved(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """What costs more with more freedom costs as much with less."""
    for name in ("FIRST", "SOLVED"):
        monkeypatch.setattr(between, name, 5)
    counted, rng = Counted(monkeypatch), np.random.default_rng(seed)
    limits = rng.uniform(0.09, 0.79, (60, 2))
    limits[:, 1] += 0.3
    found, least = least_bounds(form_of(2), limits), by_hand(limits.min(axis=1))
    assert np.all(found <= least * (1.0 + 1e-9))
    solved = by_hand(counted.rows.min(axis=1))
    for limit, bound in zip(limits, found, strict=True):
        wider = solved[np.all(counted.rows >= limit, axis=1)]
        assert bound >= np.max(wider, initial=0.0) * (1.0 - 1e-9)


def by_tens(form: Form, limits: np.ndarray) -> Optimum:
    """100 less ten times the limit, as if proven."""
    nothing, cost = np.zeros((len(limits), 1)), 100.0 - 10.0 * limits[:, 0]
    return Optimum(nothing.astype(np.int64), nothing, cost, cost, nothing)


@pytest.mark.parametrize("by_prices", [(-np.inf, -np.inf), (95.0, -np.inf), (-np.inf, 95.0)])
def test_the_best_of_all_bounds_is_kept(monkeypatch: pytest.MonkeyPatch, by_prices: tuple[float, float]) -> None:
    """By prices of the neighbour below, of that above, and by the next wider limit of 5 and 9."""
    left = list(by_prices)
    monkeypatch.setattr(between, "least_cost", by_tens)
    monkeypatch.setattr(between, "_bound_by_tangents", lambda *given: np.full(len(given[2]), left.pop(0)))
    course = between._Course(smooth(), np.arange(10.0)[:, None])
    course.solve(np.array([0, 5, 9]))
    wider = np.array([50.0] * 4 + [10.0] * 3)
    expected = np.maximum(wider, max(by_prices))
    np.testing.assert_array_equal(course.bound[[1, 2, 3, 4, 6, 7, 8]], expected)


def test_limits_that_move_alone_are_an_axis() -> None:
    """Chords of the cost hold along one limit only."""
    moving, fixed = np.linspace(0.1, 0.9, 20), np.full(20, 0.5)
    pairs: Sequence[tuple[tuple[np.ndarray, np.ndarray], int | None]] = (
        ((moving, fixed), 0), ((fixed, moving), 1), ((moving, moving), None),
        ((fixed, fixed), None), ((moving, np.full(20, np.inf)), 0),
    )  # fmt: skip
    for columns, axis in pairs:
        assert between._Course(smooth(2), np.column_stack(columns))._axis == axis


def test_ways_are_told_apart_as_long_as_they_are_few() -> None:
    """Sums over every choice of ways, or of each table's least: no more than any of them."""
    rng = np.random.default_rng(1)
    tables = [rng.uniform(0.0, 1.0, (2, 3, 4)) for _ in range(10)]
    every = between._combine_ways(tables)
    assert every.shape == (between.PAIRS, 3, 4)
    least = sum(table.min(axis=0) for table in tables)
    np.testing.assert_allclose(every.min(axis=0), least)
    more = between._combine_ways([*tables, tables[0]])
    assert more.shape == (1, 3, 4)
    np.testing.assert_allclose(more[0], least + tables[0].min(axis=0))
