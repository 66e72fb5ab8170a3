"""How far a front is from the best known one, in numbers and in words."""

from __future__ import annotations

import numpy as np
import pandas as pd

from tolevo.commands.run.proofs import distance_words
from tolevo.commands.run.references import ABOVE, above, add_distance, notes

NAMES = ["cost", "backlash_arcmin"]


def front(cost: list[float]) -> pd.DataFrame:
    return pd.DataFrame({"cost": cost, "backlash_arcmin": [1.0, 2.0, 3.0]})


def test_distance_between_two_points_of_a_front_falls_geometrically() -> None:
    best = np.array([[8.0, 1.0], [2.0, 2.0]])
    np.testing.assert_allclose(above(np.array([5.0, 1.5]), best), 25.0)


def test_points_of_the_best_front_are_not_above_it_by_rounding() -> None:
    """exp(log(c)) is 2e-16 away from c for some of these costs."""
    costs = np.linspace(3.0, 40.0, 200)
    best = np.column_stack([costs[::-1], np.arange(200.0)])
    raw = [100.0 * (c / float(np.exp(np.log(c))) - 1.0) for c in costs]
    assert max(raw) > 0.0
    assert [above(row, best) for row in best] == [0.0] * 200


def test_distances_that_are_rounding_are_told_as_such() -> None:
    assert distance_words(2.22e-14) == "less than 0.001 %"
    assert distance_words(0.0456) == "0.0456 %"
    own, other = front([17.3, 9.1, 5.7]), front([18.0, 9.5, 6.0])
    told = notes(add_distance(own, other, NAMES), "NSGA-II", other, NAMES)
    assert "cost less than 0.001 % more in the median and less than 0.001 % at most" in told[0]
    assert "which cost 4.4 % more" in told[1]
    worse = add_distance(other, own, NAMES)
    np.testing.assert_allclose(worse[ABOVE], [4.0462, 4.3956, 5.2632], rtol=1e-4)


def test_levels_that_the_other_front_does_not_reach_are_empty() -> None:
    """0 there would say that a comparison found nothing better."""
    own = pd.DataFrame({"cost": [20.0, 9.0, 6.0, 5.0], "backlash_arcmin": [0.5, 1.2, 2.0, 4.0]})
    other = pd.DataFrame({"cost": [8.0, 6.5], "backlash_arcmin": [1.1, 2.5]})
    np.testing.assert_allclose(add_distance(own, other, NAMES)[ABOVE], [np.nan, 16.154, 0.0, np.nan], rtol=1e-4)
    told = notes(add_distance(own, other, NAMES), "NSGA-II", other, NAMES)
    assert "2 of 4 points, those at levels that it reaches, cost" in told[0]
    dear = own.assign(cost=[20.0, 9.0, 6.0, 7.0])  # a point of the other front is better outright
    assert add_distance(dear, other, NAMES)[ABOVE].iloc[3] > 7.0
    assert add_distance(own, other.iloc[:0], NAMES)[ABOVE].isna().all()
    np.testing.assert_allclose(
        add_distance(own, other, NAMES, between=False)[ABOVE], [np.nan, 16.154, np.nan, np.nan], rtol=1e-4
    )
    near = other.assign(backlash_arcmin=[1.1, 1.9985])  # at one level of the front, within what counts as equal
    assert add_distance(own, near, NAMES, between=False)[ABOVE].notna().tolist() == [False, True, True, False]
    elsewhere = pd.DataFrame({"cost": [50.0], "backlash_arcmin": [9.0]})
    assert notes(add_distance(own, elsewhere, NAMES), "NSGA-II", elsewhere, NAMES)[0] == (
        "no optimum is proven for this problem"
    )
