"""The error of rows that a fit never saw: five stretches of the record, held out in turn.

What a rival names is not asked anew without a stretch, but all its numbers are, the nonlinear ones
too. Outliers are told beside the fit to all rows: a row that is predicted badly because it was held
out counts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.gap.generator.tables import Array
from benchmarks.gap.scoring.rival import Rival
from benchmarks.gap.scoring.rivals import least_left

Rows = NDArray[np.int64]
STRETCHES = 5
TO_SIGMA = 1.4826
"""Standard deviation of normal errors over their median size."""
FAR = 5.0
"""Robust standard deviations beyond which a reading is an outlier."""


def held_out(columns_of: Callable[[Rows], Array], what: Array) -> float:
    """RMSE of what (n,) without outliers; `columns_of` rows are those of a fit to them (n, m)."""
    every = np.arange(len(what))
    inside = what - predicted(columns_of(every), what, every)
    size = TO_SIGMA * np.median(np.abs(inside - np.median(inside)))
    good = np.abs(inside - np.median(inside)) <= FAR * size
    errors = np.empty(len(what))
    for rows in np.array_split(every, STRETCHES):
        rest = np.delete(every, rows)
        errors[rows] = (what - predicted(columns_of(rest), what, rest))[rows]
    return float(np.sqrt(np.mean(errors[good] ** 2)))


def predicted(columns: Array, what: Array, rows: Rows) -> Array:
    """What a fit of columns (n, m) to some rows says of all of them."""
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    return np.asarray(scaled @ np.linalg.lstsq(scaled[rows], what[rows], rcond=1e-9)[0])


def fitted(named: Sequence[tuple[Rival, Array]], at: Any, free: Array, what: Array, rows: Rows) -> Array:
    """Columns (n, m) of what is free and of names with their nonlinear parameters; those are
    fitted to some rows, each beside the others as they are.
    """
    blocks = [rival.columns(at, p) for rival, p in named]
    for k, (rival, _) in enumerate(named):
        if not rival.grids:
            continue
        beside = np.hstack([free, *blocks[:k], *blocks[k + 1 :]])[rows]
        seen = replace(rival, columns=partial(_at_rows, rival, rows))
        _, p = least_left(seen, at, beside, what[rows])
        blocks[k] = rival.columns(at, p)
    return np.hstack([free, *blocks])


def _at_rows(rival: Rival, rows: Rows, at: Any, p: Array) -> Array:
    return rival.columns(at, p)[rows]
