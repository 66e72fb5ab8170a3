"""Closed forms of the literature, and the bound against allocations drawn at random."""

from collections.abc import Sequence
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from tolevo.algorithms.exact.combination import Combination, Optimum, Path, arc_length
from tolevo.algorithms.exact.front import front
from tolevo.models.costs import CostCurve, Exponential, Reciprocal, ReciprocalSquared, Table
from tolevo.problems.forms import Feature, Form, Way

SENSITIVITY = np.array([1.0, 2.0, 0.5, 1.0])
A = np.array([2.0, 1.5, 1.0, 0.5])
B = np.array([0.04, 0.09, 0.01, 0.16])
LIMIT = np.array([[0.5]])


def form_of(
    curves: list[CostCurve],
    linear: np.ndarray,
    spread: np.ndarray,
    ends: tuple[float, float] = (1e-4, 10.0),
    constant: float = 0.0,
) -> Form:
    features = tuple(
        Feature(f"part_{at}_t", (Way(curve, *ends, (float(m),), (float(a),)),))
        for at, (curve, m, a) in enumerate(zip(curves, linear, spread, strict=True))
    )
    return Form(("variation",), features, np.zeros(1), np.array([constant]), "")


def path_of(*args: object, **kwargs: object) -> Path:
    return Path(Combination(form_of(*args, **kwargs), (0,) * 4))  # type: ignore[arg-type]


def reciprocals() -> list[CostCurve]:
    return [Reciprocal(a, b) for a, b in zip(A, B, strict=True)]


NONE = np.zeros(4)


def test_worst_case_of_reciprocal_costs_by_lagrange() -> None:
    found = path_of(reciprocals(), SENSITIVITY, NONE).least_cost(LIMIT)
    # t_j = sqrt(b_j/S_j) L / sum sqrt(b_i S_i); cost = sum a + (sum sqrt(b_i S_i))^2 / L
    by_hand = A.sum() + np.sqrt(B * SENSITIVITY).sum() ** 2 / 0.5
    np.testing.assert_allclose(found.cost, by_hand, rtol=1e-12)
    np.testing.assert_allclose(found.cost, 7.397939, atol=5e-7)  # published
    np.testing.assert_allclose(found.bound, by_hand, rtol=1e-11)


def test_root_sum_square_of_reciprocal_costs_by_lagrange() -> None:
    found = path_of(reciprocals(), NONE, SENSITIVITY).least_cost(LIMIT)
    by_hand = A.sum() + np.sum((B * SENSITIVITY) ** (2.0 / 3.0)) ** 1.5 / 0.5
    np.testing.assert_allclose(found.cost, by_hand, rtol=1e-12)
    np.testing.assert_allclose(found.cost, 6.324376, atol=5e-7)  # published
    np.testing.assert_allclose(found.bound, by_hand, rtol=1e-11)


def test_root_sum_square_of_squared_reciprocal_costs() -> None:
    curves: list[CostCurve] = [ReciprocalSquared(a, b) for a, b in zip(A, B, strict=True)]
    found = path_of(curves, NONE, SENSITIVITY).least_cost(LIMIT)
    np.testing.assert_allclose(found.cost, 11.25, rtol=1e-12)  # published
    np.testing.assert_allclose(found.bound, 11.25, rtol=1e-11)


def test_multiplier_is_the_price_of_the_limit() -> None:
    for linear, spread in ((SENSITIVITY, NONE), (NONE, SENSITIVITY), (0.3 * SENSITIVITY, A)):
        path, step = path_of(reciprocals(), linear, spread), 1e-5
        found = path.least_cost(np.array([[0.5 - step], [0.5], [0.5 + step]]))
        slope = (found.cost[2] - found.cost[0]) / (2.0 * step)
        np.testing.assert_allclose(found.multiplier[1, 0], -slope, rtol=1e-6)


CURVES: list[list[CostCurve]] = [
    reciprocals(),
    [Exponential(a, 8.0 * b, 3.0) for a, b in zip(A, B, strict=True)],
    [Table((0.0, 0.05, 0.2, 1.0, 10.0), (9.0 * b, 4.0 * b, 2.0 * b, b, 0.5 * b)) for b in B],
]
PARTS = [(SENSITIVITY, NONE), (NONE, SENSITIVITY), (0.3 * SENSITIVITY, SENSITIVITY)]


@pytest.mark.parametrize("curves", CURVES, ids=["reciprocal", "exponential", "table"])
@pytest.mark.parametrize(("linear", "spread"), PARTS, ids=["worst case", "rss", "shifted"])
@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.02, 2.0))
def test_no_allocation_costs_less_than_the_bound(
    curves: list[CostCurve], linear: np.ndarray, spread: np.ndarray, seed: int, limit: float
) -> None:
    path = path_of(curves, linear, spread, ends=(0.005, 2.0), constant=1e-5)
    found = path.least_cost(np.array([[limit]]))
    t = np.exp(np.random.default_rng(seed).uniform(np.log(0.005), np.log(2.0), (400, 4)))
    near = np.clip(found.t * np.random.default_rng(seed).uniform(0.7, 1.4, (400, 4)), 0.005, 2.0)
    t = np.vstack([t, near])
    kept = path.value(t) <= limit
    if np.isinf(found.cost[0]):
        assert not np.any(kept)
        return
    assert path.value(found.t)[0] <= limit
    assert np.all(path.combination.cost(t[kept]) >= found.bound[0])
    # tight: no gap is left where every curve is convex
    assert found.cost[0] - found.bound[0] <= 1e-9 * found.cost[0]


def test_loose_limit_leaves_everything_at_its_widest() -> None:
    found = path_of(reciprocals(), NONE, SENSITIVITY).least_cost(np.array([[1e3]]))
    np.testing.assert_array_equal(found.t, 10.0)
    assert found.multiplier[0, 0] == 0.0
    np.testing.assert_allclose(found.cost, A.sum() + B.sum() / 10.0)


def test_limits_that_do_not_bind_or_cannot_be_kept_are_not_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    """All at 10 vary by 45, all at 1e-4 by 4.5e-4."""
    monkeypatch.setattr(Path, "_inside", lambda *_: pytest.fail("nothing is to be searched"))
    found = path_of(reciprocals(), SENSITIVITY, NONE).least_cost(np.array([[4e-4], [45.1], [1e3]]))
    widest = A.sum() + B.sum() / 10.0
    np.testing.assert_allclose(found.cost, [np.inf, widest, widest])
    np.testing.assert_allclose(found.bound, [np.inf, widest, widest])


def test_a_root_without_means_has_no_root_to_agree_with(monkeypatch: pytest.MonkeyPatch) -> None:
    """At price nu, t_j = (b_j / (2 nu S_j^2))^(1/3) at once."""
    monkeypatch.setattr(Path, "_root", lambda *_: pytest.fail("no root is to be found"))
    t = path_of(reciprocals(), NONE, SENSITIVITY).at(np.array([0.5, 3.0]))
    by_hand = np.cbrt(B / (2.0 * np.array([[0.5], [3.0]]) * SENSITIVITY**2))
    np.testing.assert_allclose(t, by_hand, rtol=1e-12)


def test_between_two_optima_that_are_one_nothing_is_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    path, t = path_of(reciprocals(), SENSITIVITY, NONE), np.full((2, 4), 0.1)
    monkeypatch.setattr(Path, "value", lambda *_: pytest.fail("nothing is to be searched"))
    np.testing.assert_array_equal(path._between(t, t * (1.0 + 1e-12), np.array([0.5, 0.6])), t)


def test_impossible_limit_is_proven_impossible() -> None:
    found = path_of(reciprocals(), SENSITIVITY, NONE).least_cost(np.array([[4e-4]]))
    assert np.isinf(found.cost[0]) and np.isinf(found.bound[0])


def test_a_table_that_is_not_convex_leaves_an_honest_gap() -> None:
    bent = [Table((0.01, 0.1, 0.2, 1.0), (9.0, 8.5, 2.0, 1.9)) for _ in B]
    path = path_of(bent, SENSITIVITY, NONE, ends=(0.01, 1.0))
    found = path.least_cost(np.array([[0.7]]))
    grid = np.stack(np.meshgrid(*[np.linspace(0.01, 1.0, 34)] * 4), axis=-1).reshape(-1, 4)
    kept = path.value(grid) <= 0.7
    assert found.bound[0] <= path.combination.cost(grid[kept]).min()
    assert found.bound[0] < found.cost[0]


def test_parts_of_one_tolerance_have_one_cost_or_none() -> None:
    """No price moves t = 0.5: V = 2.25 everywhere."""
    path = path_of(reciprocals(), SENSITIVITY, NONE, ends=(0.5, 0.5))
    found = path.least_cost(np.array([[2.2], [2.25], [3.0]]))
    cost = A.sum() + B.sum() / 0.5
    np.testing.assert_allclose(found.cost, [np.inf, cost, cost], rtol=1e-14)
    np.testing.assert_allclose(found.bound, [np.inf, cost, cost], rtol=1e-14)


def test_front_by_hand_between_its_ends() -> None:
    """Worst case of reciprocals: cost = sum a + (sum sqrt(b S))^2 / V, as far as no end is met."""
    path, k = path_of(reciprocals(), SENSITIVITY, NONE), np.sqrt(B * SENSITIVITY).sum() ** 2
    t = path.front(50, upper=0.5, most=A.sum() + k / 0.1)
    value, cost = t @ SENSITIVITY, A.sum() + np.sum(B / t, axis=1)
    np.testing.assert_allclose(cost, A.sum() + k / value, rtol=1e-9)
    assert value[0] == pytest.approx(0.5, rel=1e-9) and value[0] <= 0.5
    assert value[-1] == pytest.approx(0.1, rel=1e-9) and cost[-1] <= A.sum() + k / 0.1
    steps = np.hypot(np.diff(value) / np.ptp(value), np.diff(cost) / np.ptp(cost))
    assert steps.max() < 1.02 * steps.min()  # the arcs are measured at a few points


@pytest.mark.parametrize(("upper", "most"), [(np.inf, np.inf), (1e9, 1e9), (1e-9, 0.0)])
def test_front_whose_ends_no_limit_cuts_is_whole(upper: float, most: float) -> None:
    """From all at their loosest to all at their tightest; a limit that none keeps cuts nothing."""
    path = path_of(reciprocals(), SENSITIVITY, NONE, ends=(0.01, 1.0))
    t = path.front(20, upper, most)
    np.testing.assert_allclose(t[0], 1.0, rtol=1e-12)
    np.testing.assert_allclose(t[-1], 0.01, rtol=1e-12)


def test_a_limit_that_does_not_bind_leaves_all_at_their_widest() -> None:
    """Also where the last part of a cost curve is flat, so that tighter ones cost no more."""
    flat: list[CostCurve] = [Table((0.01, 0.1, 1.0), (2.0, 1.0, 1.0))] * 4
    found = path_of(flat, SENSITIVITY, NONE, ends=(0.01, 1.0)).least_cost(np.array([[4.5], [1.0]]))
    np.testing.assert_array_equal(found.t[0], 1.0)
    assert found.t[1] @ SENSITIVITY <= 1.0
    np.testing.assert_allclose(found.cost, 4.0, rtol=1e-12)


def test_arc_length_in_units_of_each_axis() -> None:
    """An axis along which nothing moves adds nothing."""
    np.testing.assert_allclose(arc_length(np.array([[0.0, 3.0, 6.0], [5.0, 5.0, 5.0]])),
                               [0.0, 0.5, 1.0])  # fmt: skip
    np.testing.assert_allclose(arc_length(np.array([[0.0, 2.0], [1.0, 4.0]])), [0.0, np.sqrt(2.0)])


def alternatives_of(seed: int, linear: bool) -> list[list[tuple[float, float, float, float]]]:
    """A cost a + b/t between two ends for every way of three parts; one way in six is a point."""
    rng = np.random.default_rng(seed)
    ways = []
    for _ in range(int(rng.integers(2, 4) + linear)):
        low, high = np.sort(10.0 ** rng.uniform(-2.0, -0.3, 2)).tolist()
        low = high if rng.random() < 1 / 6 else low
        ways.append((float(rng.uniform(0.0, 6.0)), float(10.0 ** rng.uniform(-2.0, -0.5)), low, high))
    return [ways[at:] + ways[:at] for at in range(3)]


def least_by_hand(ways: Sequence[tuple[float, float, float, float]], s: np.ndarray, linear: bool, most: float) -> float:
    """Least cost of one way of every part where the sum, or the root sum square, is at most `most`."""
    a, b, low, high = np.array(ways).T

    def at(price: float) -> np.ndarray:
        free = np.sqrt(b / (price * s)) if linear else np.cbrt(b / (2.0 * price * s**2))
        return np.asarray(np.clip(free, low, high))

    def value(price: float) -> float:
        return float(s @ at(price)) if linear else float(np.linalg.norm(s * at(price)))

    if value(1e30) > most:
        return np.inf
    loose = value(1e-30) <= most
    price = 1e-30 if loose else np.exp(brentq(lambda x: value(np.exp(x)) - most, -69.0, 69.0, xtol=1e-13))
    return float(np.sum(a + b / at(price)))


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_front_of_alternatives_is_the_lower_envelope_of_all(seed: int, linear: bool) -> None:
    ways, s = alternatives_of(seed, linear), np.array([1.0, 0.6, 1.7])
    none = (0.0,)
    features = tuple(
        Feature(
            f"t_{at}",
            tuple(
                Way(
                    Reciprocal(a, b),
                    low,
                    high,
                    (w,) if linear else none,
                    none if linear else (w,),
                    choice=float(number),
                )
                for number, (a, b, low, high) in enumerate(own)
            ),
            f"process_{at}",
        )
        for at, (own, w) in enumerate(zip(ways, s.tolist(), strict=True))
    )
    form = Form(("variation",), features, np.zeros(1), np.zeros(1), "")
    whole = front(form, 30, np.array([np.inf]))
    upper, most = float(np.quantile(_variations(whole, s, linear), 0.7)), float(np.quantile(whole.cost, 0.8))
    for found, keeps in ((whole, (np.inf, np.inf)), (front(form, 30, np.array([upper]), most=most), (upper, most))):
        assert len(found.cost) == 30
        values = _variations(found, s, linear)
        for value, cost, chosen, t in zip(values, found.cost, found.chosen, found.t, strict=True):
            made = np.array([own[way] for own, way in zip(ways, chosen, strict=True)])
            assert np.all((made[:, 2] <= t) & (t <= made[:, 3]))
            assert cost == pytest.approx(np.sum(made[:, 0] + made[:, 1] / t), rel=1e-12)
            least = min(least_by_hand(choice, s, linear, value * (1.0 + 1e-12)) for choice in product(*ways))
            assert cost == pytest.approx(least, rel=1e-7)
        assert np.all(values <= keeps[0] * (1.0 + 1e-9))
        assert np.all(found.cost <= keeps[1] * (1.0 + 1e-9))
    cheapest = min(sum(a + b / high for a, b, _, high in choice) for choice in product(*ways))
    assert whole.cost.min() == pytest.approx(cheapest, rel=1e-9)
    assert not np.any(np.isfinite(front(form, 30, np.array([upper]), most=0.5 * cheapest).cost))


def _variations(found: Optimum, s: np.ndarray, linear: bool) -> np.ndarray:
    return np.asarray(found.t @ s if linear else np.linalg.norm(found.t * s, axis=1))


def test_an_allocation_alone_on_the_front_is_one_of_its_points() -> None:
    # bought in at one tolerance, tighter than what is made: a point, then a gap, then a curve
    ways = (Way(Reciprocal(9.0, 0.0), 0.02, 0.02, (0.0,), (1.0,)), Way(Reciprocal(1.0, 0.1), 0.05, 0.5, (0.0,), (1.0,)))
    other = (Way(Reciprocal(0.0, 0.001), 0.01, 0.0101, (0.0,), (1.0,)),)
    form = Form(("v",), (Feature("a_t", ways, "a"), Feature("b_t", other)), np.zeros(1), np.zeros(1), "")
    found = front(form, 20, np.array([np.inf]))
    assert np.any(found.chosen[:, 0] == 0)
    assert np.sum(found.chosen[:, 0] == 1) > 10


def test_two_points_of_a_front_with_alternatives_are_its_ends() -> None:
    ways = [[(9.0, 0.0, 0.02, 0.02), (1.0, 0.1, 0.05, 0.5)]] * 2
    features = tuple(
        Feature(
            f"t_{at}", tuple(Way(Reciprocal(a, b), low, high, (0.0,), (1.0,)) for a, b, low, high in own), f"p_{at}"
        )
        for at, own in enumerate(ways)
    )
    found = front(Form(("v",), features, np.zeros(1), np.zeros(1), ""), 2, np.array([np.inf]))
    assert sorted(found.cost.tolist()) == pytest.approx([2.0 * (1.0 + 0.1 / 0.5), 18.0])
