"""The final fit of numbers in the full model."""

from __future__ import annotations

import numpy as np

from tolevo.commands.gap.close import least_squares
from tolevo.section import Array

STAIR = 5e-4
ENDS = (np.array([-10.0]), np.array([10.0]))


def stairs(x: Array) -> Array:
    """A residual with its zero at 3, smooth only in the large."""
    return np.array([np.rint((x[0] - 3.0) / STAIR) * STAIR])


def test_a_residual_of_small_steps_is_fitted_in_larger_ones() -> None:
    """Over 1e-4 its derivative is 0, over 1e-3 it is not."""
    start = np.array([1.0])
    assert least_squares(stairs, start, ENDS, expected=100.0).x[0] == 1.0
    assert abs(least_squares(stairs, start, ENDS, expected=1e-6).x[0] - 3.0) < 2.0 * STAIR


def test_a_smooth_residual_is_fitted_once() -> None:
    """Where as much is left as was promised, the first fit is the answer."""
    asked = []

    def line(x: Array) -> Array:
        asked.append(float(x[0]))
        return np.array([x[0] - 3.0, 1.0])

    found = least_squares(line, np.array([1.0]), ENDS, expected=1.0)
    assert abs(found.x[0] - 3.0) < 1e-9
    assert asked.count(1.0) == 1
