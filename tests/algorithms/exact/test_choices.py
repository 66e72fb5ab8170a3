"""Alternative ways of making a part: branch and bound against enumeration by another solver."""

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import optimize

from tolevo.algorithms.exact import choices
from tolevo.algorithms.exact.choices import Solution, least_cost
from tolevo.algorithms.exact.separable import Leaf
from tolevo.models.costs import Reciprocal
from tolevo.models.propagation.convolution import EvenPlateau
from tolevo.problems.forms import Feature, Form, Piece, Quantile, Way

minimize: Any = optimize.minimize  # its stubs know arrays of one fixed dimension only


def mixed(ways: tuple[int, ...], shift: float = 0.0, seed: int = 0) -> Form:
    rng = np.random.default_rng(seed)

    def way(index: int) -> Way:
        low = rng.uniform(0.01, 0.1)
        curve = Reciprocal(rng.uniform(0.0, 3.0), rng.uniform(0.02, 0.3))
        linear, spread = shift * rng.uniform(0.5, 2.0), rng.uniform(0.5, 2.0)
        return Way(curve, low, low * rng.uniform(1.5, 4.0), (linear,), (spread,), (), float(index))

    features = tuple(
        Feature(f"part_{at}_t", tuple(way(i) for i in range(count)), f"part_{at}_process")
        for at, count in enumerate(ways)
    )
    return Form(("variation",), features, np.zeros(1), np.zeros(1), "")


def by_enumeration(form: Form, limit: float) -> float:
    """Least cost by scipy's SLSQP in t for every set of ways."""
    best = np.inf
    for chosen in itertools.product(*(feature.ways for feature in form.features)):
        low, high = np.array([w.low for w in chosen]), np.array([w.high for w in chosen])
        m = np.array([w.linear[0] for w in chosen])
        a = np.array([w.spread[0] for w in chosen])
        b = np.array([w.curve.b for w in chosen])  # type: ignore[attr-defined]
        if m @ low + np.linalg.norm(a * low) > limit:
            continue
        found = minimize(
            lambda x, b=b: np.sum(b / np.exp(x)),
            np.log(low),
            bounds=np.log(np.stack([low, high], axis=1)),
            constraints=[{
                "type": "ineq",
                "fun": lambda x, m=m, a=a: limit - m @ np.exp(x) - np.linalg.norm(a * np.exp(x)),
            }],
            method="SLSQP",
            options={"ftol": 1e-13, "maxiter": 400},
        )  # fmt: skip
        best = min(best, float(found.fun) + sum(w.curve.a for w in chosen))  # type: ignore[attr-defined]
    return best


@pytest.mark.parametrize("shift", [0.0, 0.3])
@pytest.mark.parametrize("limit", [0.2, 0.3, 0.5])
def test_optimum_is_that_of_enumeration(shift: float, limit: float) -> None:
    form = mixed((3, 3, 2, 2), shift)
    found = least_cost(form, np.array([[limit]]))
    by_hand = by_enumeration(form, limit)
    if np.isinf(by_hand):
        assert np.isinf(found.cost[0])
        return
    np.testing.assert_allclose(found.cost[0], by_hand, rtol=1e-7)  # SLSQP stops at 1e-8 or so
    np.testing.assert_allclose(found.bound[0], found.cost[0], rtol=1e-9)


def test_many_limits_at_once_are_each_solved() -> None:
    form = mixed((3, 2, 2), seed=4)
    limits = np.linspace(0.1, 0.8, 40)[:, None]
    together = least_cost(form, limits)
    for row, limit in enumerate(limits):
        alone = least_cost(form, limit[None, :])
        np.testing.assert_allclose(together.cost[row], alone.cost[0], rtol=1e-12)


def test_bounds_stay_proven_when_the_search_is_cut_short(monkeypatch: pytest.MonkeyPatch) -> None:
    form = mixed((3, 3, 3, 3), 0.2, seed=2)
    limits = np.linspace(0.3, 0.8, 9)[:, None]
    whole = least_cost(form, limits)
    monkeypatch.setattr(choices, "LEAVES", 1)
    cut = least_cost(form, limits)
    real = np.isfinite(whole.cost)
    assert real.any()
    assert np.all(cut.bound[real] <= whole.cost[real])
    assert np.all(cut.cost[real] >= whole.cost[real] * (1.0 - 1e-12))


@pytest.mark.parametrize(("ways", "shift", "seed"), [((3, 3, 3, 3), 0.2, 6), ((4, 4, 4), 0.2, 0), ((4, 4, 4), 0.2, 11)])
def test_the_bound_of_what_was_not_searched_counts(
    monkeypatch: pytest.MonkeyPatch, ways: tuple[int, ...], shift: float, seed: int
) -> None:
    """Where the first ways are not the best ones, and nothing else is looked at."""
    form, limits = mixed(ways, shift, seed), np.linspace(0.1, 0.8, 9)[:, None]
    whole = least_cost(form, limits)
    np.testing.assert_allclose(whole.bound, whole.cost, rtol=1e-9)
    monkeypatch.setattr(choices, "LEAVES", 0)
    cut = least_cost(form, limits)
    worse = np.isfinite(cut.cost) & (cut.cost > 1.02 * whole.cost)
    assert np.any(worse)
    assert np.all(cut.bound <= whole.cost)
    assert np.all(cut.bound[worse] < cut.cost[worse])
    floor = sum(min(float(w.curve.cost(np.array([w.high]))[0]) for w in f.ways)
                for f in form.features)  # fmt: skip
    assert np.all(cut.bound >= floor * (1.0 - 1e-12))


def test_wide_choice_is_proven() -> None:
    form = mixed((3,) * 10, seed=5)  # 59,049 sets of ways
    found = least_cost(form, np.array([[0.35]]))
    np.testing.assert_allclose(found.bound, found.cost, rtol=1e-9)


def ladder(parts: int) -> Form:
    """Rough, fine and finest ways of each part, each dearer and tighter than the one before."""
    rng = np.random.default_rng(7)
    features = []
    for at in range(parts):
        b, spread = rng.uniform(0.05, 0.3), rng.uniform(0.5, 2.0)
        table = ((0.3, 1.0, 0.1, 0.3), (1.5, 0.5, 0.03, 0.12), (3.5, 0.3, 0.01, 0.05))
        ways = tuple(
            Way(Reciprocal(a, share * b), low, high, (0.0,), (spread,), (), float(way))
            for way, (a, share, low, high) in enumerate(table)
        )
        features.append(Feature(f"part_{at}_t", ways, f"part_{at}_process"))
    return Form(("variation",), tuple(features), np.zeros(1), np.zeros(1), "")


@pytest.mark.parametrize("times", [1.0, 1.02, 1.3, 2.0, 8.0])
def test_limits_that_few_of_531441_sets_of_ways_keep(times: float) -> None:
    form = ladder(12)
    tightest = 0.01 * float(np.linalg.norm([f.ways[0].spread[0] for f in form.features]))
    found = least_cost(form, np.array([[times * tightest * (1.0 + 1e-9)]]))
    assert np.isfinite(found.cost[0])
    np.testing.assert_allclose(found.bound, found.cost, rtol=1e-8)
    assert found.t.shape == (1, 12)
    below = least_cost(form, np.array([[0.999 * tightest]]))
    assert np.isinf(below.cost[0]) and np.isinf(below.bound[0])


def test_optimum_of_five_steep_parts_is_that_of_enumeration() -> None:
    form = ladder(5)
    tightest = 0.01 * float(np.linalg.norm([f.ways[0].spread[0] for f in form.features]))
    for times in (1.1, 3.0):
        found = least_cost(form, np.array([[times * tightest]]))
        np.testing.assert_allclose(found.cost, by_enumeration(form, times * tightest), rtol=1e-6)


def test_no_limits_at_all_are_no_allocations() -> None:
    assert least_cost(mixed((3, 2)), np.empty((0, 1))).cost.shape == (0,)


def test_alike_parts_are_tried_in_one_order() -> None:
    one = mixed((3,), 0.2, seed=3).features[0]
    features = tuple(Feature(f"part_{at}_t", one.ways, f"part_{at}_process") for at in range(4))
    form = Form(("variation",), features, np.zeros(1), np.zeros(1), "")
    for limit in (0.35, 0.6):
        found = least_cost(form, np.array([[limit]]))
        np.testing.assert_allclose(found.cost, by_enumeration(form, limit), rtol=1e-6)
        np.testing.assert_allclose(found.bound, found.cost, rtol=1e-8)


class Priced(Reciprocal):
    """A reciprocal cost that is searched by the prices of its square."""

    @property
    def priced(self) -> bool:
        return True


def priced(form: Form) -> Form:
    """The form with curves that are."""
    features = [replace(f, ways=tuple(replace(w, curve=Priced(w.curve.a, w.curve.b))  # type: ignore[attr-defined]
                                      for w in f.ways)) for f in form.features]  # fmt: skip
    return replace(form, features=tuple(features))


def test_choices_by_prices_of_squares_are_those_of_enumeration(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where a limit that none keeps stands between two others."""
    monkeypatch.setattr(choices, "MAX_UNPRICED_COMBINATIONS", 1)
    form = mixed((3, 2, 2), seed=4)
    limits = [0.6, 0.001, 0.3, 0.25]
    found = least_cost(priced(form), np.array(limits)[:, None])
    by_hand = [by_enumeration(form, limit) for limit in limits]
    assert np.isinf(by_hand[1]) and np.all(np.isfinite(by_hand)[[0, 2, 3]])
    np.testing.assert_allclose(found.cost, by_hand, rtol=1e-6)
    np.testing.assert_allclose(found.bound, by_hand, rtol=1e-6)


@pytest.mark.parametrize(("cost", "bound", "proven"), [
    (9.0, 8.5, 8.5), (9.0, 9.1, 9.0), (9.0, -3.0, 1.5), (9.0, -np.inf, 1.5),
    (np.inf, np.inf, np.inf),
])  # fmt: skip
def test_a_bound_by_prices_lies_between_the_least_cost_of_all_and_that_which_was_found(
    monkeypatch: pytest.MonkeyPatch, cost: float, bound: float, proven: float
) -> None:
    """Without limits the part costs 1 + 0.5/1."""
    way = Way(Priced(1.0, 0.5), 0.1, 1.0, (0.0,), (1.0,))
    form = Form(("v",), (Feature("t", (way, way), "p"),), np.zeros(1), np.zeros(1), "")
    leaf = Leaf((0,), np.full(1, 0.5), cost, bound, np.ones(1))
    monkeypatch.setattr(choices, "MAX_UNPRICED_COMBINATIONS", 1)
    monkeypatch.setattr(choices, "least_leaf", lambda squares, limit, known: (leaf, bound))
    found = least_cost(form, np.array([[0.5]]))
    assert (found.cost[0], found.bound[0]) == (cost, proven)


@pytest.mark.parametrize("kept", [True, False])
def test_what_a_master_problem_does_not_find_is_not_called_impossible(
    monkeypatch: pytest.MonkeyPatch, kept: bool
) -> None:
    """Its proven bound stands without a cost; with one the solution's own does."""

    class Master:
        proven = 7.0

        def __init__(self, *given: object) -> None:
            assert len(given) == 4

        def run(self) -> Solution | None:
            one = np.ones(1)
            return Solution((1,), 0.3 * one, 9.0, 8.0) if kept else None

    quantile = Quantile(0.9, ((Piece(1.0, EvenPlateau()),),))
    way = Way(Reciprocal(1.0, 0.5), 0.1, 1.0, (0.0,), (1.0,))
    form = Form(("v",), (Feature("t", (way, way), "p"),), np.zeros(1), np.zeros(1), "",
                quantiles=(quantile,))  # fmt: skip
    monkeypatch.setattr(choices, "MIXED", 1)
    monkeypatch.setattr(choices, "Master", Master)
    found = least_cost(form, np.array([[0.5]]))
    assert found.cost[0] == (9.0 if kept else np.inf)
    assert found.bound[0] == (8.0 if kept else 7.0)
    assert found.chosen[0, 0] == int(kept)
