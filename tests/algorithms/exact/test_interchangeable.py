"""Two drives that may change places: nothing but the full model decides which is the finer one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.algorithms.exact.parts_by_hand import form, way
from tolevo.algorithms.exact.choices import best_search_vectors, interchangeable_features, least_cost
from tolevo.models.propagation.convolution import EvenPlateau
from tolevo.problems.forms import Feature, Form, Piece, Quantile, Way

Array = NDArray[np.float64]
LIMITS = np.linspace(0.8, 2.6, 13)[:, None]


def drive(rounding: float = 0.0) -> list[Way]:
    """A rough and a fine way whose ranges leave a gap: one drive of each is often cheapest."""
    spread = (1.0 + rounding,)
    return [way(0.0, 0.3, 1.2, 2.0, (0.0,), spread), way(0.7, 0.1, 0.3, 0.6, (0.0,), spread)]


def two_drives(roundings: tuple[float, float] = (0.0, 0.0), **more: Any) -> Form:
    link = [way(0.0, 0.2, 0.1, 0.5, (0.0,), (1.0,))]
    return form(drive(roundings[0]), link, drive(roundings[1]), **more)


class Machine:
    """What the solver asks of a problem: an accuracy with a sensitivity of its own to each drive."""

    def __init__(self, sensitivity: tuple[float, float], most: float = np.inf) -> None:
        self.sensitivity, self.most = sensitivity, most
        self.free = [type("Variable", (), {"name": name})() for name in ("t0", "c0", "t1", "c1", "t2", "c2")]
        self.xl, self.xu = np.full(6, -np.inf), np.full(6, np.inf)

    def form_columns(self, columns: Mapping[str, Array]) -> dict[str, Array]:
        return dict(columns)

    def accuracy(self, x: Array) -> Array:
        first, last = self.sensitivity
        return np.asarray(np.sqrt((first * x[:, 0]) ** 2 + x[:, 2] ** 2 + (last * x[:, 4]) ** 2))

    def tested(self, x: Array) -> tuple[Array, Array]:
        accuracy = self.accuracy(x)
        cost = np.where(x[:, 1] > 0.0, 0.7, 0.0) + np.where(x[:, 5] > 0.0, 0.7, 0.0)
        return np.stack([cost, accuracy], axis=1), (accuracy / self.most - 1.0)[:, None]


def numbered(own: Form) -> Form:
    features = tuple(
        replace(f, ways=tuple(replace(w, choice=float(at)) for at, w in enumerate(f.ways))) for f in own.features
    )
    return replace(own, features=features)


@pytest.mark.parametrize("rounding", [1e-14, -1e-14, 2e-13])
def test_rounding_does_not_decide_which_drive_is_finer(rounding: float) -> None:
    """A last digit more in the sensitivity of either drive makes it a little dearer to leave rough."""
    found = [least_cost(two_drives(pair), LIMITS) for pair in ((0.0, 0.0), (rounding, 0.0), (0.0, rounding))]
    mixed = found[0].chosen[:, 0] != found[0].chosen[:, 2]
    assert 2 <= np.count_nonzero(mixed) < len(LIMITS)
    for other in found[1:]:
        np.testing.assert_array_equal(other.chosen, found[0].chosen)
        np.testing.assert_allclose(other.cost, found[0].cost, rtol=1e-11)
        np.testing.assert_allclose(other.t, found[0].t, rtol=1e-9)


@pytest.mark.parametrize("sensitivity", [(1.3, 0.7), (0.7, 1.3)])
def test_the_drive_that_matters_more_is_the_finer_one(sensitivity: tuple[float, float]) -> None:
    """Both orders of two drives have one front, and the finer drive is where the accuracy needs it."""
    own = replace(numbered(two_drives()), exact=False)
    found = least_cost(own, LIMITS)
    machine, turned = Machine(sensitivity), Machine(sensitivity[::-1])
    x, y = (best_search_vectors(each, own, found) for each in (machine, turned))  # type: ignore[arg-type]
    mixed = x[:, 1] != x[:, 5]
    assert np.count_nonzero(mixed) >= 2
    np.testing.assert_allclose(x[:, [4, 5, 2, 3, 0, 1]][mixed], y[mixed], rtol=1e-12)
    np.testing.assert_allclose(machine.accuracy(x), turned.accuracy(y), rtol=1e-12)
    finer = 0 if sensitivity[0] > sensitivity[1] else 4
    assert np.all(x[mixed, finer] < x[mixed, 4 - finer])
    np.testing.assert_array_equal(np.sort(x[:, [0, 4]], axis=1), np.sort(found.t[:, [0, 2]], axis=1))


def test_of_places_of_one_cost_one_that_keeps_the_limits_counts() -> None:
    """The first order has an accuracy of sqrt((1.3 * 1.2)^2 + ...), beyond the limit; the other keeps it."""
    own = replace(numbered(two_drives()), exact=False)
    found = least_cost(own, LIMITS)
    free = Machine((1.3, 0.7))
    row = np.flatnonzero(found.chosen[:, 0] != found.chosen[:, 2])[:1]
    best = best_search_vectors(free, own, found.at(row))  # type: ignore[arg-type]
    worse = best[:, [4, 5, 2, 3, 0, 1]]
    limited = Machine((1.3, 0.7), most=float(np.mean([free.accuracy(best)[0], free.accuracy(worse)[0]])))
    x = best_search_vectors(limited, own, found.at(row))  # type: ignore[arg-type]
    np.testing.assert_array_equal(x, best)
    assert limited.tested(x)[1][0, 0] < 0.0 < limited.tested(worse)[1][0, 0]


def test_an_exact_form_is_not_computed_again() -> None:
    """Its places are equal in every objective, so that they stay in order."""
    own = numbered(two_drives())
    found = least_cost(own, LIMITS)
    x = best_search_vectors(Machine((1.3, 0.7)), own, found)  # type: ignore[arg-type]
    assert np.all(x[:, 1] <= x[:, 5])


def law(weight: float) -> tuple[Piece, ...]:
    return (Piece(weight, EvenPlateau(0.5)),)


def test_only_features_that_are_the_same_in_everything_change_places() -> None:
    own = two_drives()
    first, link, last = own.features
    dearer = Feature("t2", (way(0.0, 0.31, 1.2, 2.0, (0.0,), (1.0,)), last.ways[1]), "c2")
    wider = Feature("t2", (way(0.0, 0.3, 1.2, 2.1, (0.0,), (1.0,)), last.ways[1]), "c2")
    assert interchangeable_features(own) == [[0, 2]]
    assert interchangeable_features(two_drives((0.0, 1e-9))) == []
    for other in (dearer, wider, replace(last, count=2), replace(last, ways=last.ways[:1])):
        assert interchangeable_features(replace(own, features=(first, link, other))) == []
    unequal = np.array([[1.0, 0.3, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, 1.0]])
    equal = np.array([[1.0, 0.3, 0.2], [0.3, 1.0, 0.3], [0.2, 0.3, 1.0]])
    assert interchangeable_features(replace(own, correlation=unequal)) == []
    assert interchangeable_features(replace(own, correlation=equal)) == [[0, 2]]
    for weight, groups in ((1.0, [[0, 2]]), (2.0, [])):
        quantile = Quantile(0.99, (law(1.0), law(1.0), law(weight)))
        assert interchangeable_features(replace(own, quantiles=(quantile,))) == groups
