"""The values that can be ordered next to those of a design."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...problems.interfaces import Drawing
from ...problems.tolerance_problem import ToleranceProblem

Mask = NDArray[np.bool_]
SLACK = 1e-9
"""Relative difference that counts as none."""


@dataclass(frozen=True, slots=True, eq=False)
class Neighbours:
    """The orderable values next to those of a design (all variables,): `below` and `above`.

    Both have shape (k,), for the variables of the columns `at` (k,); they are equal where there is
    one neighbour only.
    """

    design: Array
    at: NDArray[np.int64]
    below: Array
    above: Array

    def designs(self, up: Mask) -> Array:
        """Full designs (c, all variables) of choices (c, k): the upper neighbour where true."""
        full = np.repeat(self.design[None], len(up), axis=0)
        full[:, self.at] = np.where(up, self.above, self.below)
        return full

    @property
    def nearest(self) -> Mask:
        """The nearer neighbour of each variable (k,)."""
        values = self.design[self.at]
        return np.asarray(self.above - values < values - self.below)


def neighbours(problem: ToleranceProblem, design: Array, values: dict[str, Array]) -> Neighbours:
    """The neighbours of `design` among the orderable `values` by variable, in the room it has.

    A variable without an orderable value in its room keeps its own.
    """
    at, below, above = [], [], []
    for name, orderable in values.items():
        low, high = Drawing.of(problem).room(name, design)
        column = problem.names.index(name)
        value = design[column]
        edge = SLACK * max(abs(low), abs(high))
        within = np.clip(orderable[(orderable >= low - edge) & (orderable <= high + edge)], low, high)
        if not len(within):
            continue
        lower, upper = within[within <= value], within[within >= value]
        at.append(column)
        below.append(lower.max() if len(lower) else upper.min())
        above.append(upper.min() if len(upper) else lower.max())
    return Neighbours(design, np.array(at, dtype=np.int64), np.array(below), np.array(above))
