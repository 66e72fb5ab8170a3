"""Median of a response at every setting, with its bootstrap interval over the seeds."""

from __future__ import annotations

from functools import partial

import numpy as np
import pandas as pd
from scipy.stats import bootstrap

from ....arrays import Array
from .resampling import LEVEL
from .runs import Runs

percentile_bootstrap = partial(
    bootstrap, vectorized=True, n_resamples=2000, confidence_level=LEVEL, method="percentile"
)
BATCH = 2_000_000
"""Resampled values held at a time, so that thousands of settings fit into memory."""


def medians(runs: Runs, rng: np.random.Generator) -> pd.DataFrame:
    """Columns response, point, median, low, high, level, n, failed, reached; a row per setting.

    NaN where nothing is known: all runs failed, or half of them did not reach the response.
    """
    known = (~np.isnan(runs.array)).sum(axis=1)
    intervals = np.full((len(known), 3), np.nan)
    for count in np.unique(known[known > 0]):
        rows = known == count
        values = np.sort(runs.array[rows], axis=1)[:, :count]  # NaN comes last
        intervals[rows] = interval_of_median(values, rng)
    return pd.DataFrame(
        {"response": runs.response, "point": np.arange(len(known))}
        | dict(zip(("median", "low", "high"), intervals.T, strict=True))
        | {"level": LEVEL, "n": known, "failed": runs.replicates - known}
        | {"reached": np.isfinite(runs.array).sum(axis=1)}
    )


def interval_of_median(values: Array, rng: np.random.Generator) -> Array:
    """Median, low and high, shape (rows, 3), of values (rows, n); NaN where they are infinite."""
    middle = np.median(values, axis=1)
    with np.errstate(invalid="ignore"):
        if values.shape[1] < 2:
            low, high = np.full((2, len(values)), np.nan)
        else:
            batch = max(1, BATCH // values.size)
            interval = percentile_bootstrap((values,), np.median, axis=1, batch=batch, rng=rng).confidence_interval
            low, high = np.asarray(interval.low), np.asarray(interval.high)
        stacked = np.column_stack([middle, low, high])
    return np.where(np.isfinite(stacked), stacked, np.nan)
