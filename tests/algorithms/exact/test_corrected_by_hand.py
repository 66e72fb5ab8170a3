"""Limits moved by what a model says more than its form: one part, 1/t under a form that says t."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tolevo.algorithms.exact.corrected import DEARER, EXCESS_TOLERANCE, FURTHER, ROUNDS, Corrected
from tolevo.models.costs import Reciprocal
from tolevo.problems.forms import Feature, Form, Way

Array = np.ndarray
LIMIT = np.array([1.0])


def form_of(*ways: tuple[float, float]) -> Form:
    """Ways of a price a, and of a share of t that the form says."""
    own = tuple(Way(Reciprocal(a, 1.0), 0.01, 5.0, (share,), (0.0,), (), float(at))
                for at, (a, share) in enumerate(ways))  # fmt: skip
    return Form(("v",), (Feature("t", own, "p" if len(own) > 1 else ""),), np.zeros(1),
                np.zeros(1), "")  # fmt: skip


class Told(Corrected):
    """The search vector is way and t; the model says `truth` of the way, t and how often it was
    asked.
    """

    def __init__(self, form: Form, truth: Callable[[int, float, int], float]) -> None:
        self.truth, self.asked = truth, 0
        prices = [way.curve for way in form.features[0].ways]
        problem = SimpleNamespace()
        vars(problem).update(
            free=[SimpleNamespace(name="p"), SimpleNamespace(name="t")],
            xl=-np.inf,
            xu=np.inf,
            form_columns=lambda columns: {"p": np.zeros(1)} | columns,
            complete=lambda x: x,
            needed_outputs=lambda x: {"cost": prices[int(x[0, 0])].cost(x[:, 1])},
            form_values=lambda _, x, __: np.array([[self.said(int(x[0, 0]), float(x[0, 1]))]]),
            violations=lambda _, __: np.array([[self.last - 1.0]]),
        )
        run: Any = SimpleNamespace(problem=problem)
        super().__init__(run, form)

    def said(self, way: int, t: float) -> float:
        self.asked += 1
        self.last = self.truth(way, t, self.asked)
        return self.last


@pytest.mark.parametrize(("factor", "more"), [(1.05, 0.01), (1.0, 0.2), (0.99, 0.0)])
def test_a_point_keeps_its_limit_in_truth_and_hardly_less(factor: float, more: float) -> None:
    """factor t + more <= 1: the least cost is factor / (1 - more)."""
    told = Told(form_of((0.0, 1.0)), lambda _, t, __: factor * t + more)
    found = told.point((0,), LIMIT)
    assert found is not None
    value = factor * found.t[0] + more
    assert 1.0 - EXCESS_TOLERANCE <= value <= 1.0
    assert found.cost == pytest.approx(factor / (1.0 - more), rel=2.0 * EXCESS_TOLERANCE / (1.0 - more))
    before = told.asked
    again = told.point((0,), LIMIT)  # with the limit as it was moved
    assert again is not None and told.asked == before + 1


def test_a_limit_is_moved_five_times_and_ten_more_where_it_is_broken_by_little() -> None:
    """By chance a point lies far inside, or is broken by little or much, whatever is asked."""
    inside = Told(form_of((0.0, 1.0)), lambda *_: 0.9)
    assert inside.point((0,), LIMIT) is not None and inside.asked == ROUNDS
    little = Told(form_of((0.0, 1.0)), lambda *_: 1.001)
    assert little.point((0,), LIMIT) is None and little.asked == ROUNDS + FURTHER
    much = Told(form_of((0.0, 1.0)), lambda *_: 1.1)
    assert much.point((0,), LIMIT) is None and much.asked == ROUNDS
    late = Told(form_of((0.0, 1.0)), lambda _, __, asked: 1.001 if asked < 8 else 0.9)
    assert late.point((0,), LIMIT) is not None and late.asked == 8


def test_what_is_clearly_dearer_is_not_corrected_further() -> None:
    """1.05 t <= 1 costs 1.05; than 1.05 / 1.003 the first point is dearer already."""
    for than, asked in ((1.04 / DEARER, 2), (2.0, None)):
        told = Told(form_of((0.0, 1.0)), lambda _, t, __: 1.05 * t)
        found = told.point((0,), LIMIT, than=than)
        assert (found is None) == (asked is not None)
        assert asked is None or told.asked == asked


def test_the_way_beside_the_forms_own_is_taken_where_the_model_likes_it_better() -> None:
    """The form says t and 1.002 t, which is hardly dearer; in truth it is 1.02 t and 1.01 t."""
    truth = (1.02, 1.01)
    told = Told(form_of((0.0, 1.0), (0.0, 1.002)), lambda way, t, _: truth[way] * t)
    found = told.best((0,), LIMIT)
    assert found is not None and found.ways == (1,)
    assert found.cost == pytest.approx(1.01, rel=2.0 * EXCESS_TOLERANCE)
