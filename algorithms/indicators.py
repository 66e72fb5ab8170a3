"""Dominance and hypervolume: of two objectives by sorting, of more by moocore."""

from __future__ import annotations

import numpy as np

from ..arrays import Array, Flags

REFERENCE = 1.1
"""Reference point of the normalised hypervolume, in every objective."""


def nondominated(values: Array) -> Flags:
    """Which rows of (n, objectives) no other row dominates; the first of equal rows is kept."""
    if values.shape[1] == 1:
        best = np.zeros(len(values), dtype=bool)
        if len(values):
            best[int(np.argmin(values[:, 0]))] = True
        return best
    if values.shape[1] == 2:
        order = np.lexsort((values[:, 1], values[:, 0]))  # stable: the first of equal rows leads
        second = values[order, 1]
        before = np.minimum.accumulate(np.concatenate([[np.inf], second[:-1]]))
        kept = np.zeros(len(values), dtype=bool)
        kept[order] = second < before
        return kept
    import moocore

    mask = moocore.is_nondominated(values, keep_weakly=False)
    return np.asarray(mask, dtype=bool)


def hypervolume(values: Array, ideal: Array, nadir: Array) -> float:
    """Hypervolume of (F - ideal)/(nadir - ideal) with reference point 1.1."""
    scaled = (values - ideal) / (nadir - ideal)
    inside = scaled[np.all(scaled < REFERENCE, axis=1)]
    if not len(inside):
        return 0.0
    if scaled.shape[1] == 1:
        return float(REFERENCE - inside.min())
    if scaled.shape[1] == 2:
        front = inside[nondominated(inside)]
        return area(*front[np.argsort(front[:, 0])].T)
    import moocore

    return float(moocore.hypervolume(inside, ref=np.full(scaled.shape[1], REFERENCE)))


def area(first: Array, second: Array) -> float:
    """Hypervolume of a front of two objectives (n,) each, normalised, sorted by the first, all of
    it below the reference point.
    """
    if not len(first):
        return 0.0
    widths = np.empty(len(first))
    np.subtract(first[1:], first[:-1], out=widths[:-1])
    widths[-1] = REFERENCE - first[-1]
    return float(widths @ (REFERENCE - second))
