"""The inputs by which points separate two explanations."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from ....models.measurable import Role
from .contest import Chosen, Contest
from .field import Field
from .points import Axis

CELLS = 12
"""Number of stretches of an input over which means are taken."""


def decisive_inputs(field: Field, contest: Contest, chosen: Chosen) -> tuple[str, ...]:
    """The two inputs on which the difference of the explanations depends most: by the correlation
    ratio of it, or of its square, over all candidates.
    """
    _, coefficients, _ = contest.level(chosen)
    residual = contest.residual - contest.columns @ coefficients
    signed = residual.reshape(len(residual), -1, field.per_candidate).sum(axis=1).ravel()

    def strength(axis: Axis) -> float:
        values = field.data.values(axis.column.name)
        return max(_ratio(values, signed), _ratio(values, signed**2))

    moving = [axis for axis in field.axes if axis.span.high > axis.span.low and axis.column.role is not Role.TIME]
    return tuple(axis.column.name for axis in sorted(moving, key=strength, reverse=True)[:2])


def _ratio(values: Array, of: Array) -> float:
    """Fraction of the variance of `of` (n,) explained by its means over stretches of values (n,)."""
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, CELLS + 1)))
    cell = np.searchsorted(edges[1:-1], values, side="right")
    count = np.bincount(cell)
    means = np.bincount(cell, of) / np.maximum(count, 1)
    total = float(np.var(of))
    between = float(count @ (means - of.mean()) ** 2) / len(of)
    return between / total if total > 0.0 else 0.0
