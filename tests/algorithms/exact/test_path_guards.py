"""What the path along the price keeps whatever its root finder and its duals bring, by hand."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tolevo.algorithms.exact import combination as module
from tolevo.algorithms.exact.combination import Combination, Path, arc_length
from tolevo.models.costs import CostCurve, Reciprocal, Table
from tolevo.problems.forms import Feature, Form, Way


def path_of(*curves: CostCurve, ends: tuple[float, float] = (0.1, 1.0)) -> Path:
    """The path of V = t_1 + t_2 + ... with these cost curves."""
    features = tuple(Feature(f"t{at}", (Way(curve, *ends, (1.0,), (0.0,)),)) for at, curve in enumerate(curves))
    form = Form(("sum",), features, np.zeros(1), np.zeros(1), "")
    return Path(Combination(form, (0,) * len(curves)))


def test_a_sum_that_no_price_moves() -> None:
    """Where tight tolerances cost no more than wide ones, the tightest cost least at any price."""
    path = path_of(Table((0.1, 1.0), (3.0, 3.0)), Table((0.1, 1.0), (2.0, 2.0)))
    low, high = path.ends
    assert low < high
    np.testing.assert_allclose(path.cheapest, [0.1, 0.1], rtol=1e-15)
    np.testing.assert_allclose(path.tightest, [0.1, 0.1], rtol=1e-15)
    solved = path.least_cost(np.array([[0.1], [0.3]]))
    assert np.isinf(solved.cost[0]) and np.isinf(solved.bound[0])
    assert solved.cost[1] == 5.0 and solved.bound[1] == 5.0


def test_between_two_entries_of_a_table_the_cost_is_on_the_line() -> None:
    """At the price of a straight piece its whole length is optimal: the limit picks the point."""
    table = Table((0.1, 0.4, 1.0), (9.0, 3.0, 0.0))
    limits = np.array([[0.25], [0.4], [0.7]])
    solved = path_of(table).least_cost(limits)
    np.testing.assert_allclose(solved.cost, [6.0, 3.0, 1.5], rtol=1e-9)
    np.testing.assert_allclose(solved.t[:, 0], limits[:, 0], rtol=1e-9)
    np.testing.assert_allclose(solved.bound, [6.0, 3.0, 1.5], rtol=1e-9)


def dual_of(factor: float) -> Callable[..., Any]:
    """A dual that is `factor` times the true least cost of two parts 1/t within t_1 + t_2 <= L."""
    return lambda _combination, _multiplier, limits, _t: factor * 4.0 / limits[:, 0]


@pytest.mark.parametrize(
    ("factor", "bound"),
    [(0.9, 7.2), (-1.0, 2.0), (2.0, 8.0)],
    ids=["a weak dual is reported as it is", "least cost without a limit", "no more than the cost"],
)
def test_a_bound_is_what_the_duals_prove(monkeypatch: pytest.MonkeyPatch, factor: float, bound: float) -> None:
    """Two parts 1/t within t_1 + t_2 <= 0.5 cost 8, and 2 without a limit."""
    monkeypatch.setattr(Combination, "dual", dual_of(factor))
    solved = path_of(Reciprocal(0.0, 1.0), Reciprocal(0.0, 1.0)).least_cost(np.array([[0.5]]))
    np.testing.assert_allclose(solved.cost, 8.0, rtol=1e-12)
    np.testing.assert_allclose(solved.bound, bound, rtol=1e-12)


def test_a_root_that_breaks_the_limit_is_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a root finder brings prices at which the limit is broken, the tightest are taken."""

    class Loose:
        """A root, and a bracket whose two ends are the loosest price."""

        def __init__(self, ends: tuple[float, float], limit: np.ndarray) -> None:
            self.x = np.full(len(limit), ends[0])
            self.bracket = self.x, self.x

    monkeypatch.setattr(module, "bracketed_roots", lambda _excess, ends, limit: Loose(ends, limit))
    path = path_of(Reciprocal(0.0, 1.0), Reciprocal(0.0, 1.0))
    solved = path.least_cost(np.array([[0.5]]))
    assert solved.t.sum() <= 0.5 + 1e-12
    assert solved.cost[0] >= 8.0 - 1e-9


def test_points_of_a_front_are_evenly_spaced() -> None:
    """The prices between all loosest and all tightest alone measure its length."""
    path = path_of(Reciprocal(0.0, 1.0), Reciprocal(0.0, 2.0))
    t = path.front(11)
    steps = np.diff(arc_length(np.stack([path.value(t), path.combination.cost(t)])))
    np.testing.assert_allclose(steps, steps.mean(), rtol=0.02)
