"""Alternative ways of making a part: branch and bound against enumeration by another solver."""

import itertools
from typing import Any

import numpy as np
import pytest
from scipy import optimize

from tolevo.algorithms.exact import choices
from tolevo.algorithms.exact.choices import least_cost
from tolevo.models.costs import Reciprocal
from tolevo.problems.forms import Feature, Form, Way

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
