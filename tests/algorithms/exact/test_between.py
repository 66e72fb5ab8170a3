"""Bounds between solved limits: the 90 % quantile of a uniform part is 0.8 t, so C = 1 + 0.8/L."""

from __future__ import annotations

import numpy as np
import pytest

from tolevo.algorithms.exact import between
from tolevo.algorithms.exact.between import least_bounds
from tolevo.algorithms.exact.choices import least_cost
from tolevo.models.costs import Reciprocal
from tolevo.models.propagation.even import EvenPlateau
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
