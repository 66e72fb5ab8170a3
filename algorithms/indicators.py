"""Dominance and hypervolume, over moocore."""

from __future__ import annotations

import moocore
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
REFERENCE = 1.1
"""Reference point of the normalised hypervolume, in every objective."""


def nondominated(values: Array) -> NDArray[np.bool_]:
    """Which rows of (n, objectives) no other row dominates; the first of equal rows is kept."""
    if values.shape[1] == 1:
        best = np.zeros(len(values), dtype=bool)
        if len(values):
            best[int(np.argmin(values[:, 0]))] = True
        return best
    found = moocore.is_nondominated(values, keep_weakly=False)
    return np.asarray(found, dtype=bool)


def hypervolume(values: Array, ideal: Array, nadir: Array) -> float:
    """Hypervolume of (F - ideal)/(nadir - ideal) with reference point 1.1."""
    scaled = (values - ideal) / (nadir - ideal)
    inside = scaled[np.all(scaled < REFERENCE, axis=1)]
    if not len(inside):
        return 0.0
    if scaled.shape[1] == 1:
        return float(REFERENCE - inside.min())
    return float(moocore.hypervolume(inside, ref=np.full(scaled.shape[1], REFERENCE)))
