"""Choices against fronts whose knee is known, and TOPSIS against its published example."""

from dataclasses import replace

import numpy as np
import pytest

from tolevo.commands.run.choice import (
    Points,
    best_trade_off,
    choose_by_topsis,
    choose_by_weights,
    choose_rows,
    closeness,
    farthest_from_chord,
    largest_product,
    sensitivity,
    sharpest_bend,
)

KNEES = (farthest_from_chord, sharpest_bend, best_trade_off, largest_product)


def kinked(count: int = 101) -> np.ndarray:
    """Two straight lines that meet in (2, 30), the row in the middle."""
    left = np.stack([np.linspace(1.0, 2.0, count), np.linspace(100.0, 30.0, count)], axis=1)
    right = np.stack([np.linspace(2.0, 6.0, count), np.linspace(30.0, 10.0, count)], axis=1)
    return np.vstack([left, right[1:]])


@pytest.mark.parametrize("rule", KNEES)
def test_every_definition_finds_the_corner_of_a_front_with_one(rule) -> None:  # type: ignore[no-untyped-def]
    values = kinked()
    order = np.random.default_rng(0).permutation(len(values))
    found = rule(values[order])
    assert values[order][found].tolist() == [2.0, 30.0]


@pytest.mark.parametrize("rule", KNEES)
def test_a_symmetric_hyperbola_has_its_knee_in_the_middle(rule) -> None:  # type: ignore[no-untyped-def]
    x = np.geomspace(0.25, 4.0, 201)
    assert rule(np.stack([x, 1.0 / x], axis=1)) == 100


def test_two_close_points_make_no_bend() -> None:
    values = np.vstack([kinked(), [[4.0 + 1e-9, 20.0 - 1e-3]]])
    found = sharpest_bend(values)
    assert found is not None
    assert values[found].tolist() == [2.0, 30.0]


@pytest.mark.parametrize("rule", KNEES)
def test_two_points_have_no_knee(rule) -> None:  # type: ignore[no-untyped-def]
    assert rule(np.array([[1.0, 2.0], [2.0, 1.0]])) is None


def test_a_front_that_bends_the_other_way_has_no_bend() -> None:
    angle = np.linspace(0.0, np.pi / 2.0, 51)
    assert sharpest_bend(np.stack([np.sin(angle), np.cos(angle)], axis=1)) is None


def test_topsis_of_the_fighter_aircraft() -> None:
    """Hwang & Yoon (1981), chapter III: closeness 0.643, 0.268, 0.613, 0.312; A1 is chosen."""
    rated = np.array([
        [2.0, 1500, 20000, 5.5, 5, 9],
        [2.5, 2700, 18000, 6.5, 3, 5],
        [1.8, 2000, 21000, 4.5, 7, 7],
        [2.2, 1800, 20000, 5.0, 5, 5],
    ])  # fmt: skip
    minimised = rated * [-1, -1, -1, 1, -1, -1]
    weights = np.array([0.2, 0.1, 0.1, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(closeness(minimised, weights), [0.643, 0.268, 0.613, 0.312],
                               atol=6e-4)  # fmt: skip
    assert choose_by_topsis(minimised, weights) == 0


def test_pseudo_weights_of_a_straight_front_are_its_places() -> None:
    x = np.linspace(0.0, 1.0, 11)
    values = np.stack([x, 5.0 * (1.0 - x)], axis=1)
    assert choose_by_weights(values, np.array([0.7, 0.3])) == 3
    assert choose_by_weights(np.ones((3, 2)), np.array([0.5, 0.5])) is None


def points(**more) -> Points:  # type: ignore[no-untyped-def]
    cost = np.array([10.0, 6.0, 4.0])
    values = np.stack([cost, [1.0, 2.0, 3.0]], axis=1)
    return replace(Points(values, ("cost", "error"), cost, np.array([0.5, 0.5])), **more)


def test_cheapest_within_limits_and_best_for_budget() -> None:
    found = choose_rows(points(kept=np.array([True, True, False]), budget=6.5))
    assert found["cheapest_within_limits"] == 1
    assert found["best_for_budget"] == 1
    nothing = choose_rows(points(kept=np.zeros(3, dtype=bool), budget=1.0))
    assert {"cheapest_within_limits", "best_for_budget"}.isdisjoint(nothing)


def test_a_single_objective_has_one_choice() -> None:
    one = Points(np.array([[3.0], [2.0]]), ("cost",), np.array([3.0, 2.0]), np.ones(1))
    assert choose_rows(one) == {"only": 1}


def test_a_dearer_curve_moves_the_choice_to_what_the_money_still_buys() -> None:
    """Of 10, 6, 4 the first curve is 5, 1, 1: at 1.2 times it they cost 11, 6.2, 4.2."""
    part = np.array([5.0, 1.0, 1.0])
    found = sensitivity(points(budget=10.5), {"a_um": part, "b_um": np.zeros(3)})
    own = found[found["choice"] == "best_for_budget"].to_dict("records")
    rows = {(row["curve"], row["factor"]): row for row in own}
    dear = rows["a_um", 1.2]
    assert (dear["point"], dear["same"], dear["error"]) == (1, False, 2.0)
    assert dear["cost"] == pytest.approx(6.2)
    assert dear["cost_kept"] == pytest.approx(11.0)
    cheap = rows["a_um", 0.8]
    assert (cheap["point"], cheap["same"], cheap["cost"]) == (0, True, 9.0)
    assert rows["b_um", 0.8]["same"] and rows["b_um", 1.2]["same"]


def test_a_cost_that_is_no_objective_moves_nothing() -> None:
    assert sensitivity(points(names=("mass", "error")), {"a_um": np.ones(3)}).empty
