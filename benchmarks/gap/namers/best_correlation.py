"""The column that goes along best with what is left."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import stats

from benchmarks.gap.generator.records import Record
from benchmarks.gap.namers.seen import dictionary, said_of, seen, standardised

LEVEL = 0.05


def best_correlation(record: Record) -> dict[str, Any]:
    """The name whose column correlates best, if that correlation would be significant had it been
    the only one that was tried.
    """
    found = seen(record)
    of = dictionary(found)
    n = len(found)
    r = np.clip(of.columns.T @ standardised(found.left) / n, -1.0, 1.0)
    best = int(np.argmax(np.abs(r)))
    chance = float(stats.beta(n / 2 - 1, n / 2 - 1, loc=-1, scale=2).sf(abs(r[best])) * 2.0)
    return said_of(found, of, (np.arange(len(r)) == best) & (chance < LEVEL))
