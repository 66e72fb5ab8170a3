"""Forward selection by the Bayesian information criterion (Schwarz 1978), as it stands."""

from __future__ import annotations

from functools import partial
from math import log
from typing import Any

import numpy as np

from benchmarks.gap.generator.records import Record
from benchmarks.gap.generator.tables import Array
from benchmarks.gap.namers.seen import Seen, said_as_fitted, seen
from benchmarks.gap.scoring.held_out import fitted
from benchmarks.gap.scoring.rival import Rival
from benchmarks.gap.scoring.rivals import least_left, without

MOST = 4
"""Effects that it may add."""


def selected(found: Seen) -> list[tuple[Rival, Array]]:
    """Names with their nonlinear parameters: that which lowers n ln(RSS) + k ln(n) most is added, as long
    as one does.
    """
    n, free = len(found), found.free
    named: list[tuple[Rival, Array]] = []
    left = float((without(free, found.left) ** 2).sum())
    while len(named) < MOST:
        fits = [(*least_left(one, found.points, free, found.left), one) for one in found.rivals]
        scores = [n * log(rss / left) + one.count * log(n) for rss, _, one in fits]
        best = int(np.argmin(scores))
        if scores[best] >= 0.0:
            break
        left, p, rival = fits[best]
        named.append((rival, p))
        free = np.hstack([free, rival.columns(found.points, p)])
    return named


def plain_bic(record: Record) -> dict[str, Any]:
    """The names that are selected, and the error of rows that a fit of them never saw."""
    found = seen(record)
    named = selected(found)
    names = [rival.name for rival, _ in named]
    columns_of = partial(fitted, named, found.points, found.free, found.left)
    return said_as_fitted(found, names, columns_of)
