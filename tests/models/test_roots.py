"""Roots against closed forms, and against scipy's implementation of the same method."""

import numpy as np
from scipy.optimize.elementwise import find_root

from tolevo.models.roots import bracketed_roots
from tolevo.section import Array


def excess(x: Array, y: Array) -> Array:
    return np.exp(x) - y


def test_logarithms_to_the_last_digits() -> None:
    y = np.geomspace(1e-8, 1e8, 60).reshape(3, 20)
    found = bracketed_roots(excess, (-50.0, 50.0), y)
    np.testing.assert_allclose(found.x, np.log(y), rtol=0, atol=8 * np.spacing(20.0))
    low, high = found.bracket
    assert np.all((excess(low, y) <= 0.0) & (excess(high, y) >= 0.0))
    theirs = find_root(excess, (-50.0, 50.0), args=(y,))
    np.testing.assert_allclose(found.x, theirs.x, rtol=0, atol=8 * np.spacing(20.0))


def test_ends_keep_their_order_and_what_has_no_root_is_not_a_number() -> None:
    found = bracketed_roots(excess, (3.0, -3.0), np.array([1.0, 1e9, np.exp(3.0)]))
    np.testing.assert_allclose(found.x, [0.0, np.nan, 3.0], rtol=0, atol=1e-14)
    assert found.bracket[0][0] >= found.bracket[1][0]


def test_a_step_and_a_flat_root_end() -> None:
    at = np.linspace(0.1, 0.9, 5)
    steps = bracketed_roots(lambda x, p: np.where(x < p, -1.0, 1e-12), (0.0, 1.0), at)
    np.testing.assert_allclose(steps.x, at, rtol=4e-16)
    flat = bracketed_roots(lambda x: x**9, (-1.0, 2.0))
    np.testing.assert_allclose(flat.x, 0.0, atol=1e-30)
