"""Orders of several keys and lowest ranks against numpy's lexsort and moocore."""

from __future__ import annotations

from typing import Any

import moocore
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from tolevo.algorithms.archive import PASSES, lexicographic_order, lowest_ranks_in_order, ranks

Array = NDArray[np.float64]
TIED = st.sampled_from([-np.inf, -1.5, -0.0, 0.0, 1.0, 2.0, 1e300])
FEW, MANY = st.integers(0, 4).map(float), st.floats(-1e9, 1e9)


def tables(columns: st.SearchStrategy[int], values: st.SearchStrategy[float]) -> Any:
    """Rows with few different values: ties in one column, and equal rows."""
    shapes = st.tuples(st.integers(1, 40), columns)
    return shapes.flatmap(lambda shape: arrays(float, shape, elements=values))


@given(tables(st.integers(1, 4), TIED | FEW | MANY))
def test_order_is_that_of_lexsort(keys: Array) -> None:
    np.testing.assert_array_equal(lexicographic_order(*keys.T), np.lexsort(keys.T[::-1]))


@given(tables(st.integers(1, 3), FEW | MANY), st.integers(1, 45))
def test_lowest_ranks_are_those_of_moocore(f: Array, enough: int) -> None:
    f = f[lexicographic_order(*f.T)]
    expected = moocore.pareto_rank(f)
    np.testing.assert_array_equal(ranks(f), expected)
    found = lowest_ranks_in_order(f, enough)
    reached = np.sort(expected)[min(enough, len(f)) - 1]
    known = expected <= reached
    np.testing.assert_array_equal(found[known], expected[known])
    assert np.all(found[~known] > reached)


@pytest.mark.parametrize("front", [1, 3])
def test_more_ranks_than_passes(front: int) -> None:
    level = np.repeat(np.arange(2.0 * PASSES), front)
    place = np.tile(np.arange(float(front)), 2 * PASSES)
    f = np.column_stack([level + place / front, level + 1.0 - place / front])
    order = lexicographic_order(*f.T)
    found = lowest_ranks_in_order(f[order], len(f))
    np.testing.assert_array_equal(found, level[order])


def test_a_point_beside_the_last_of_a_front_is_dominated_though_it_is_there_twice() -> None:
    f = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 1.0], [2.0, 0.0], [2.0, 0.0]])
    np.testing.assert_array_equal(lowest_ranks_in_order(f, 5), [0, 1, 1, 0, 0])


def test_nothing_has_no_ranks() -> None:
    assert lowest_ranks_in_order(np.empty((0, 2)), 3).tolist() == []
