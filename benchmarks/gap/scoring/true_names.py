"""The held-out error of somebody who knows which names of the library are in a record."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from benchmarks.gap.generator.records import record
from benchmarks.gap.generator.tables import Array
from benchmarks.gap.scoring.rivals import RIVALS, least_left

STRETCHES = 5
FAR = 5.0
"""Robust standard deviations beyond which a reading is left out."""


@lru_cache(maxsize=1024)
def true_error(group: str, number: int) -> float:
    """Root mean square [unit of the output] of readings that the fit of the true names, each by the
    notes' formula at its best nonlinear parameters, never saw; five stretches are held out in turn.
    A part that is outside of the library is left to nobody.
    """
    found, truth = record(group, number)
    output = next(str(name) for name in found.table if str(name).endswith("_predicted"))
    gap = found.table[output.removesuffix("_predicted")] - found.table[output]
    y = np.asarray(gap, dtype=np.float64) * (-1.0 if truth.turned else 1.0)
    parts: list[Array] = [truth.free]
    for one in truth.hidden[: len(truth.hidden) - truth.outside]:
        others = [other.added[:, None] for other in truth.hidden if other is not one]
        free = np.hstack([truth.free, *others])
        own = [rival for rival in RIVALS[truth.kind] if rival.name == one.name]
        fits = [(*least_left(rival, truth.points, free, one.added), rival) for rival in own]
        _, p, best = min(fits, key=lambda each: each[0])
        parts.append(best.columns(truth.points, p))
    x = np.hstack(parts)
    x = x / np.maximum(np.linalg.norm(x, axis=0), 1e-300)
    which = np.arange(len(y)) * STRETCHES // len(y)
    left = np.empty(len(y))
    for k in range(STRETCHES):
        out = which == k
        left[out] = y[out] - x[out] @ np.linalg.lstsq(x[~out], y[~out], rcond=1e-9)[0]
    size = 1.4826 * float(np.median(np.abs(left - np.median(left))))
    return float(np.sqrt(np.mean(left[np.abs(left) < FAR * size] ** 2)))
