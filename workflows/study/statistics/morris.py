"""Elementary effects of the settings, with the noise of the runs taken out."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from .resampling import Estimates, crossed, over_settings, random_settings


def effects(values: Array, shares: Array, rng: np.random.Generator) -> Estimates:
    """mu_star and sigma of every key, shape (2 keys,), per full range of the key.

    `values` (settings, replicates) in the order of the trajectories, NaN where a run failed: a seed
    is left out of a step in which one of its two runs failed. `shares` (settings, keys) are the
    places in the grid. The absolute value of an effect is its product with the sign that the other
    seeds give it: the mean is 0 for a key that does nothing, and never too large. sigma^2 is the
    variance between trajectories without that of the runs.
    """
    keys = shares.shape[1]
    paths = shares.reshape(-1, keys + 1, keys)
    runs_of = values.reshape(-1, keys + 1, values.shape[1])
    steps = np.diff(paths, axis=1)
    changed = np.abs(steps).argmax(axis=2)
    slopes = np.diff(runs_of, axis=1) / np.take_along_axis(steps, changed[..., None], axis=2)
    ordered = np.take_along_axis(slopes, np.argsort(changed, axis=1)[..., None], axis=1)
    known = ~np.isnan(ordered)
    slope, known = np.where(known, ordered, 0.0).swapaxes(0, 1), known.swapaxes(0, 1)

    def statistic(rows: Array, runs: Array) -> Array:
        per_key = [_of_key(key_slope, runs * at, rows) for key_slope, at in zip(slope, known, strict=True)]
        return np.stack([*(mean for mean, _ in per_key), *(v for _, v in per_key)], axis=-1)

    estimates = random_settings(statistic, len(paths), values.shape[1], rng)
    value, low, high = (_rooted(side, keys) for side in (estimates.value, estimates.low, estimates.high))
    return Estimates(value, low, high)


def _of_key(slope: Array, weights: Array, rows: Array) -> tuple[Array, Array]:
    """Mean absolute effect and variance of the effects of one key, each of shape (draws,)."""
    total = weights.sum(-1, keepdims=True)
    others = (weights * slope).sum(-1, keepdims=True) - weights * slope
    remaining = total - weights
    signed = np.where(remaining > 0, np.sign(others), 0.0)
    counts = total[..., 0]
    seeds = (weights > 0).sum(-1)
    size = (weights * slope * signed).sum(-1) / np.where(counts > 0, counts, 1.0)
    star = over_settings(np.where(seeds > 1, size, np.nan), rows)
    mean = (weights * slope).sum(-1) / np.where(counts > 0, counts, 1.0)
    usable = seeds > 1
    mean = np.where(usable, mean, 0.0)
    between = over_settings(crossed(slope, slope, weights), rows)
    return star, between - crossed(mean, mean, rows * usable)


def _rooted(values: Array, keys: int) -> Array:
    """The second half as standard deviations; a variance below 0 is none."""
    return np.concatenate([values[:keys], np.sqrt(np.maximum(values[keys:], 0.0))])
