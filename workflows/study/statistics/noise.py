"""The noise of the runs: what the seed changes at one setting."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from .resampling import Estimates, crossed, fixed_settings, over_settings, random_settings


def noise_share(values: Array, group: int, rng: np.random.Generator) -> Estimates:
    """Share of the noise in the variance of a run over settings and seeds, shape (1,).

    `values` (settings, replicates), NaN where a run failed. `group` settings in a row belong
    together and are sampled together; 0 for settings that are no sample.
    """
    known = ~np.isnan(values)
    counts = np.maximum(known.sum(axis=0), 1)
    filled = np.where(known, values, 0.0)
    centred = np.where(known, values - filled.sum(axis=0) / counts, 0.0)
    settings = len(values)

    def statistic(rows: Array, runs: Array) -> Array:
        rows = np.repeat(rows, max(group, 1), axis=1) if group else np.ones((1, settings))
        runs = np.repeat(runs, group, axis=1) if group and runs.shape[1] > 1 else runs
        weights = runs * known
        within = over_settings(variance(filled, weights), rows)
        between = over_settings(crossed(centred, centred, weights), rows)
        total = within + np.maximum(between, 0.0)
        return np.divide(within, total, out=np.zeros_like(within), where=total > 0.0)[:, None]

    if group:
        return random_settings(statistic, settings // group, values.shape[1], rng)
    return fixed_settings(statistic, values.shape[1], rng)


def variance(values: Array, weights: Array) -> Array:
    """Weighted variance over the last axis without bias; NaN where there are less than two runs."""
    total = weights.sum(-1)
    safe = np.where(total > 0, total, 1.0)
    mean = (weights * values).sum(-1) / safe
    spread = (weights * (values - mean[..., None]) ** 2).sum(-1) / safe
    correction = 1.0 - (weights**2).sum(-1) / safe**2
    usable = correction > 1e-9
    return np.where(usable & (total > 0), spread / np.where(usable, correction, 1.0), np.nan)
