"""Which tolerance matters how much at a point: shares of a requirement in percent."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ...arrays import Array
from ...problems.tolerance_problem import ToleranceProblem
from .slopes import Slopes, tolerances_of

CANCELLED = 1e-3
"""Fraction of the magnitudes below which a sum of contributions counts as zero."""


def contributions(problem: ToleranceProblem, slopes: Slopes) -> pd.DataFrame:
    """Share [%] of every tolerance in every requirement at the points of `slopes`.

    The share is t dy/dt over its sum over all tolerances, fixed ones included, so that the shares
    of a point add up to 100 %: of a root sum of squares it is the share of the variance, of a worst
    case that of the sum. It is negative where wider is better. One row per point and output:
    `point`, `output`, `explained` (the output whose derivative is taken, where the objective has
    none), `along` (the sum of t dy/dt, in the unit of the output; NaN shares where it cancels) and
    a column per tolerance.
    """
    names = [v.name for v in tolerances_of(problem)]
    if not names or not slopes.along:
        return pd.DataFrame()
    frames = []
    for output, slopes_along in slopes.along.items():
        frame = pd.DataFrame(_shares(slopes_along), columns=names)
        frame.insert(0, "point", slopes.rows)
        frame.insert(1, "output", output)
        frame.insert(2, "explained", slopes.source[output])
        frame.insert(3, "along", slopes_along.sum(axis=1))
        frames.append(frame)
    return pd.concat(frames, ignore_index=True)


def _shares(along: Array) -> Array:
    """Contributions `along` (n, tolerances) over their sum, in percent."""
    whole, size = along.sum(axis=1, keepdims=True), np.abs(along).sum(axis=1, keepdims=True)
    known = np.abs(whole) > CANCELLED * size
    return np.asarray(100.0 * np.divide(along, whole, out=np.full_like(along, np.nan), where=known))
