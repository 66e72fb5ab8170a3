"""Distance of a formula from the edge of its domain.

The margin of a function is the distance of its argument from the edge of its domain, above 0
inside:

    asin, acos   1 - |x|             sqrt, log   x
    a/b          b, by its sign at the middle
    a**b         a for a fractional b, a by its sign at the middle for a negative b
    tan          distance from the nearest pole of the period of the middle
    atan2        distance from the half line on which it jumps, by the side of the middle
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce

import numpy as np

from ...arrays import Array
from .formula import Formula
from .tree import Call, Expression, Operation

Values = list[Array]


def domain_margin(formula: Formula, x: Mapping[str, Array], middle: Mapping[str, Array]) -> Array:
    """The least margin at quantities `x` over all functions, each relative to that at the `middle`.

    1 at the middle, 0 at the edge of the domain, below 0 outside of it; infinite where
    the formula has a value everywhere. `x` broadcasts to the shape of the result, `middle` holds
    single numbers.
    """
    with np.errstate(all="ignore"):
        return _least(formula.tree, x, middle)[2]


def _least(node: Expression, x: Mapping[str, Array], middle: Mapping[str, Array]) -> tuple[Array, Array, Array]:
    """Value and value at the middle of a node, and the least margin at or below it."""
    below = [_least(part, x, middle) for part in node.parts]
    values, centres = [value for value, _, _ in below], [centre for _, centre, _ in below]
    margin = reduce(np.fmin, (margin for _, _, margin in below), np.asarray(np.inf))
    distance, at_middle = _distance(node, values, centres), _distance(node, centres, centres)
    if distance is not None and at_middle is not None:
        margin = np.fmin(margin, distance / np.where(at_middle > 0.0, at_middle, np.nan))
    return node.value(values, x), node.value(centres, middle), margin


def _distance(node: Expression, values: Values, centres: Values) -> Array | None:
    """Distance from the edge of the domain of a node; None where it is defined everywhere."""
    if isinstance(node, Operation):
        return _distance_of_operation(node.sign, values, centres)
    if not isinstance(node, Call):
        return None
    match node.function:
        case "asin" | "acos":
            return np.asarray(1.0 - np.abs(values[0]))
        case "sqrt" | "log":
            return values[0]
        case "tan":
            period = np.pi * np.floor(centres[0] / np.pi + 0.5)
            return np.asarray(0.5 * np.pi - np.abs(values[0] - period))
        case "atan2":
            y, x = np.broadcast_arrays(*values)
            return np.where(x > 0.0, np.hypot(y, x), y * np.where(centres[0] < 0.0, -1.0, 1.0))
    return None


def _distance_of_operation(sign: str, values: Values, centres: Values) -> Array | None:
    left, right = values
    if sign == "/":
        return np.asarray(right * np.sign(centres[1]))
    if sign == "**" and not np.all(centres[1] == np.rint(centres[1])):
        return left
    if sign == "**" and np.any(centres[1] < 0.0):
        return np.asarray(left * np.sign(centres[0]))
    return None
