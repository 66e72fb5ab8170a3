"""Cost-tolerance curves: derivative, fall, limits, bad coefficients."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tolevo.models.costs import (
    CURVES,
    Combined,
    CostCurve,
    Exponential,
    Reciprocal,
    ReciprocalPower,
    ReciprocalSquared,
    Table,
)

SMOOTH: list[CostCurve] = [
    Reciprocal(1.0, 2.0),
    ReciprocalSquared(0.5, 3.0),
    ReciprocalPower(0.1, 2.0, 0.7),
    Exponential(1.0, 4.0, 0.3),
    Combined(0.2, 1.5, 1.3, 2.0, 0.4),
]
TABLE = Table((1.0, 2.0, 4.0), (9.0, 5.0, 5.0))


@pytest.mark.parametrize("curve", SMOOTH, ids=repr)
def test_slope_is_the_central_difference(curve: CostCurve) -> None:
    t = np.geomspace(0.3, 20.0, 12)
    step = 1e-5 * t  # truncation 1e-10 and rounding 1e-11 of the value, relative
    difference = (curve.cost(t + step) - curve.cost(t - step)) / (2.0 * step)
    np.testing.assert_allclose(curve.slope(t), difference, rtol=1e-7)


BY_HAND = [
    1.0 + 2.0 / 2.0,
    0.5 + 3.0 / 4.0,
    0.1 + 2.0 / 1.624504793,
    1.0 + 4.0 * 0.548811636,
    0.2 + 1.5 / 2.462288827 + 2.0 * 0.449328964,
]


@pytest.mark.parametrize(("curve", "cost"), list(zip(SMOOTH, BY_HAND, strict=True)))
def test_cost_at_two_by_hand(curve: CostCurve, cost: float) -> None:
    np.testing.assert_allclose(curve.cost(np.array([2.0])), cost, rtol=1e-8)


@given(st.sampled_from([*SMOOTH, TABLE]), st.floats(1.0, 4.0), st.floats(1.0, 4.0))
def test_cost_never_rises_with_the_tolerance(curve: CostCurve, one: float, other: float) -> None:
    t = np.array(sorted([one, other]))
    cost = curve.cost(t)
    assert cost[1] <= cost[0]
    assert np.all(curve.slope(t) <= 0.0)


@pytest.mark.parametrize("curve", [*SMOOTH, TABLE], ids=repr)
def test_good_coefficients_have_no_fault(curve: CostCurve) -> None:
    assert curve.faults() == []


@pytest.mark.parametrize(
    ("curve", "fields"),
    [
        (Reciprocal(0.0, -1.0), ["b"]),
        (ReciprocalSquared(0.0, -1.0), ["b"]),
        (ReciprocalPower(0.0, -1.0, -1.0), ["b", "k"]),
        (Exponential(0.0, -1.0, -2.0), ["b", "m"]),
        (Combined(0.0, -1.0, -1.0, -1.0, -1.0), ["b", "k", "c", "m"]),
        (Table((1.0,), (1.0,)), ["t"]),
        (Table((1.0, 2.0), (1.0,)), ["t"]),
        (Table((2.0, 1.0), (1.0, 2.0)), ["t"]),
        (Table((1.0, 1.0), (2.0, 1.0)), ["t"]),
    ],
    ids=repr,
)
def test_every_bad_coefficient_is_named(curve: CostCurve, fields: list[str]) -> None:
    assert [field for field, _ in curve.faults()] == fields


def test_table_is_linear_between_its_entries() -> None:
    t = np.array([1.0, 1.5, 2.0, 3.0, 4.0])
    np.testing.assert_array_equal(TABLE.cost(t), [9.0, 7.0, 5.0, 5.0, 5.0])
    np.testing.assert_array_equal(TABLE.slope(t), [-4.0, -4.0, 0.0, 0.0, 0.0])


def test_table_outside_its_range_is_infinite() -> None:
    t = np.array([0.99, 4.01])
    np.testing.assert_array_equal(TABLE.cost(t), [np.inf, np.inf])
    assert np.all(np.isnan(TABLE.slope(t)))


def test_registry_names_every_curve() -> None:
    assert set(CURVES.values()) == {*map(type, SMOOTH), Table}


PRICES = [(0.7, 0.0), (0.0, 0.3), (0.4, 0.2), (1e-9, 0.0), (0.0, 1e9), (-0.1, 0.5)]
BENT = Table((0.5, 1.0, 2.0, 3.0, 4.0), (9.0, 8.5, 5.0, 4.9, 1.0))
"""A table that is not convex."""


@pytest.mark.parametrize("prices", PRICES)
@pytest.mark.parametrize("curve", [*SMOOTH, TABLE, BENT], ids=repr)
def test_best_tolerance_is_that_of_a_dense_grid(curve: CostCurve, prices: tuple[float, float]) -> None:
    low, high = 1.1, 3.7
    t = np.linspace(low, high, 200_001)

    def total(t: np.ndarray) -> np.ndarray:
        return curve.cost(t) + prices[0] * t + prices[1] * t**2

    found = curve.best(np.array([prices[0]]), np.array([prices[1]]), low, high)
    assert np.all((found >= low) & (found <= high))
    # the grid can miss the minimum by its own curvature over half a step
    assert total(found)[0] <= total(t).min() * (1.0 + 1e-15)


@given(st.sampled_from(SMOOTH), st.floats(1e-3, 1e3), st.floats(0.0, 1e3))
def test_best_tolerance_balances_cost_and_price(curve: CostCurve, p: float, q: float) -> None:
    t = curve.best(np.array([p]), np.array([q]), 1e-6, 1e6)
    rise = (curve.slope(t) + p + 2.0 * q * t) / (p + 2.0 * q * t)
    at_low = t <= 1e-6  # an exponential falls nowhere fast enough for a high price
    np.testing.assert_allclose(np.where(at_low, np.minimum(rise, 0.0), rise), 0.0, atol=1e-9)


def test_a_table_bends_where_its_slope_falls() -> None:
    assert all(curve.bends == () for curve in [*SMOOTH, TABLE])
    assert BENT.bends == (1.0, 3.0)  # slopes -1, -3.5, -0.1, -3.9
