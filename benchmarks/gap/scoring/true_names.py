"""The held-out error of somebody who knows which names of the library are in a record."""

from __future__ import annotations

from functools import lru_cache, partial

import numpy as np

from benchmarks.gap.generator.records import record
from benchmarks.gap.scoring.held_out import fitted, held_out
from benchmarks.gap.scoring.rivals import RIVALS, least_left


@lru_cache(maxsize=1024)
def true_error(group: str, number: int) -> float:
    """Root mean square [unit of the output] of readings that the fit of the true names, each by the
    notes' formula at its best nonlinear parameters, never saw. A part outside of the library
    is left to nobody.
    """
    found, truth = record(group, number)
    output = next(str(name) for name in found.table if str(name).endswith("_predicted"))
    gap = found.table[output.removesuffix("_predicted")] - found.table[output]
    y = np.asarray(gap, dtype=np.float64) * (-1.0 if truth.turned else 1.0)
    named = []
    for one in truth.hidden[: len(truth.hidden) - truth.outside]:
        others = [other.added[:, None] for other in truth.hidden if other is not one]
        free = np.hstack([truth.free, *others])
        own = [rival for rival in RIVALS[truth.kind] if rival.name == one.name]
        fits = [(*least_left(rival, truth.points, free, one.added), rival) for rival in own]
        _, p, best = min(fits, key=lambda each: each[0])
        named.append((best, p))
    return held_out(partial(fitted, named, truth.points, truth.free, y), y)
