"""Sequentially thresholded least squares (SINDy: Brunton, Proctor and Kutz 2016)."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.gap.generator.records import Record
from benchmarks.gap.generator.tables import Array
from benchmarks.gap.namers.seen import dictionary, said_of, seen, standardised

RIDGE = 0.05
THRESHOLD = 0.1
MOST_ROUNDS = 20
"""The three are the defaults of PySINDy's STLSQ; columns and readings have variance 1 here."""


def ridge(columns: Array, what: Array) -> Array:
    """Coefficients (m,) that minimise |what - columns c|^2 + RIDGE |c|^2."""
    normal = columns.T @ columns + RIDGE * np.eye(columns.shape[1])
    return np.asarray(np.linalg.solve(normal, columns.T @ what), dtype=np.float64)


def thresholded(columns: Array, what: Array) -> Array:
    """Which columns (m,) survive: fit, drop all below the threshold, fit the rest, to the end."""
    kept = np.ones(columns.shape[1], dtype=bool)
    for _ in range(MOST_ROUNDS):
        found = np.zeros(len(kept))
        found[kept] = ridge(columns[:, kept], what)
        before, kept = kept, np.abs(found) >= THRESHOLD
        if (kept == before).all():
            break
    return kept


def thresholded_least_squares(record: Record) -> dict[str, Any]:
    """Every name of the dictionary with a coefficient of a tenth of the gap's scatter at least."""
    found = seen(record)
    of = dictionary(found)
    return said_of(found, of, thresholded(of.columns, standardised(found.left)))
