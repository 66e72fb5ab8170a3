"""Sobol indices of the settings, with the noise of the runs taken out."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from ..designs.sobol import PARTS
from .resampling import Estimates, crossed, fraction_of, over_settings, random_settings

SOBOL_LEVEL = 0.90
"""Level of the intervals: the one at which they are calibrated."""


def indices(values: Array, keys: int, rng: np.random.Generator) -> Estimates:
    """First-order and total indices, shape (2 keys,): all S1, then all ST.

    `values` (settings, replicates) is ordered as `designs.sobol` orders its points, NaN where a run
    failed: a seed is left out of a block in which one of its runs failed. ST as Jansen 1999. S1 is
    (1 - w) of that of Saltelli et al. 2010, which is exact for a key that does nothing, and w of
    that of Jansen, which is exact for one that does all, w = ST. Numerators are over pairs of
    different seeds, the denominator is the variance between settings without the noise.
    """
    blocks = values.reshape(-1, keys + 2, values.shape[1])
    whole = np.asarray(np.isfinite(blocks).all(axis=1), dtype=np.bool_)
    ends = np.where(whole[:, None], blocks, np.nan)[:, [0, -1]]
    # What a seed does alike at every setting is no effect of a setting.
    blocks = np.where(whole[:, None], blocks - _mean_of_seeds(ends), 0.0)
    a, b, mixed = blocks[:, 0], blocks[:, -1], blocks[:, 1:-1].swapaxes(0, 1)

    def statistic(rows: Array, runs: Array) -> Array:
        weights = runs * whole
        squares = crossed(a, a, weights) + crossed(b, b, weights)
        centre = _centre(a + b, rows, weights) / 2
        total = over_settings(squares, rows) / 2 - centre**2
        first = [over_settings(crossed(b, mix - a, weights), rows) for mix in mixed]
        last = [over_settings(crossed(a - mix, a - mix, weights), rows) / 2 for mix in mixed]
        rest = [over_settings(crossed(b - mix, b - mix, weights), rows) / 2 for mix in mixed]
        small, whole_share, others = (fraction_of(np.stack(parts, axis=-1), total) for parts in (first, last, rest))
        weight = np.clip(whole_share, 0.0, 1.0)
        large = np.where(total[:, None] > 0.0, 1.0 - others, 0.0)
        return np.concatenate([(1.0 - weight) * small + weight * large, whole_share], axis=-1)

    return random_settings(statistic, len(blocks), values.shape[1], rng, PARTS, SOBOL_LEVEL)


def _mean_of_seeds(ends: Array) -> Array:
    """Mean of each seed over A and B, shape (1, 1, replicates); 0 where it has no whole block."""
    known = ~np.isnan(ends)
    counts = np.maximum(known.sum(axis=(0, 1)), 1)
    return np.asarray(np.where(known, ends, 0.0).sum(axis=(0, 1)) / counts)[None, None]


def _centre(values: Array, rows: Array, weights: Array) -> Array:
    """Weighted mean of all values, shape (draws,)."""
    counts = weights.sum(-1)
    means = (weights * values).sum(-1) / np.where(counts > 0, counts, 1.0)
    return over_settings(np.where(counts > 0, means, np.nan), rows)
