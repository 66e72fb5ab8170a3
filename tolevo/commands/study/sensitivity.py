"""Sensitivity of a response of a study: shares of variance, Sobol indices and elementary effects."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from ...section import Array
from .designs import PARTS, SHARE
from .plan import Factor, StudySettings
from .statistics import (
    Contrast,
    Estimates,
    Runs,
    complete_seeds,
    cross_mean,
    fixed_settings,
    fraction_of,
    mean_over_settings,
    model,
    noise_share,
    random_settings,
    variance,
)

# Shares of the variance of one run, noise included: the fraction that each key explains.
#
# They are estimated over pairs of different seeds, so that noise adds nothing to the share of a key.
# The settings are those of the design; the intervals are over seeds.


def effect_of(values: Array, weights: Array) -> Array:
    """Variance of the levels (levels, replicates) without the noise; shape (draws,)."""
    return _squares(values - values.mean(axis=0), weights)


def key_shares(values: Array, contrast: Contrast, rng: np.random.Generator) -> Estimates:
    """One at a time: share of one key in the variance of a run over its levels, shape (1,)."""
    levels = complete_seeds(contrast.table(values).T)

    def statistic(rows: Array, weights: Array) -> Array:
        effect = effect_of(levels, weights)
        return fraction_of(effect[:, None], effect + variance(levels, weights).mean(-1))

    return fixed_settings(statistic, levels.shape[1], rng)


def factorial_shares(values: Array, contrasts: list[Contrast], rng: np.random.Generator) -> tuple[list[str], Estimates]:
    """Shares of every key and every pair of keys, and their names."""
    whole = complete_seeds(values)
    means: dict[tuple[str, ...], Array] = {(contrast.key,): _means(whole, contrast.members) for contrast in contrasts}
    effects = dict(means)
    for a, b in combinations(contrasts, 2):
        cells = _cells(len(values), a, b)
        joint = _means(whole, tuple(cells.values()))
        first, second = np.array(list(cells)).T
        effects[a.key, b.key] = joint - means[(a.key,)][first] - means[(b.key,)][second]

    def statistic(rows: Array, weights: Array) -> Array:
        between = effect_of(whole, weights)
        parts = np.stack([_squares(effect, weights) for effect in effects.values()], axis=-1)
        return fraction_of(parts, between + variance(whole, weights).mean(-1))

    return [" x ".join(keys) for keys in effects], fixed_settings(statistic, whole.shape[1], rng)


def _means(values: Array, members: tuple[np.ndarray, ...]) -> Array:
    """Mean over the settings of each level less that of all, shape (levels, replicates)."""
    means = np.stack([values[rows].mean(axis=0) for rows in members])
    return np.asarray(means - values.mean(axis=0))


def _squares(values: Array, weights: Array) -> Array:
    return np.asarray(cross_mean(values, values, weights).mean(-1))


def _cells(settings: int, a: Contrast, b: Contrast) -> dict[tuple[int, int], np.ndarray]:
    """The settings at each level of one key and each level of the other."""
    of_a, of_b = np.empty(settings, dtype=int), np.empty(settings, dtype=int)
    for where, contrast in ((of_a, a), (of_b, b)):
        for at, rows in enumerate(contrast.members):
            where[rows] = at
    pairs = [(i, j) for i in range(len(a.levels)) for j in range(len(b.levels))]
    return {(i, j): np.flatnonzero((of_a == i) & (of_b == j)) for i, j in pairs}


def surface_shares(
    values: Array, design: pd.DataFrame, factors: tuple[Factor, ...], rng: np.random.Generator
) -> Estimates:
    """Latin hypercube: shares of every key by a line and a curve (a list: by its levels)."""
    whole = complete_seeds(values)
    models = [model(design, tuple(other for other in factors if other is not omitted)) for omitted in (None, *factors)]
    parts = [np.linalg.qr(columns)[0] for columns in models]

    def statistic(rows: Array, weights: Array) -> Array:
        between = effect_of(whole, weights)
        explained = [cross_mean(q.T @ whole, q.T @ whole, weights).sum(-1) for q in parts]
        gains = np.stack([explained[0] - part for part in explained[1:]], axis=-1) / len(whole)
        return fraction_of(gains, between + variance(whole, weights).mean(-1))

    return fixed_settings(statistic, whole.shape[1], rng)


# Sobol indices of the settings, with the noise of the runs taken out.


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
        squares = cross_mean(a, a, weights) + cross_mean(b, b, weights)
        centre = _centre(a + b, rows, weights) / 2
        total = mean_over_settings(squares, rows) / 2 - centre**2
        first = [mean_over_settings(cross_mean(b, mix - a, weights), rows) for mix in mixed]
        last = [mean_over_settings(cross_mean(a - mix, a - mix, weights), rows) / 2 for mix in mixed]
        rest = [mean_over_settings(cross_mean(b - mix, b - mix, weights), rows) / 2 for mix in mixed]
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
    return mean_over_settings(np.where(counts > 0, means, np.nan), rows)


# Elementary effects of the settings, with the noise of the runs taken out.


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
        per_key = [_key_effects(key_slope, runs * at, rows) for key_slope, at in zip(slope, known, strict=True)]
        return np.stack([*(mean for mean, _ in per_key), *(v for _, v in per_key)], axis=-1)

    estimates = random_settings(statistic, len(paths), values.shape[1], rng)
    value, low, high = (
        np.concatenate([side[:keys], np.sqrt(np.maximum(side[keys:], 0.0))])
        for side in (estimates.value, estimates.low, estimates.high)
    )
    return Estimates(value, low, high)


def _key_effects(slope: Array, weights: Array, rows: Array) -> tuple[Array, Array]:
    """Mean absolute effect and variance of the effects of one key, each of shape (draws,)."""
    total = weights.sum(-1, keepdims=True)
    others = (weights * slope).sum(-1, keepdims=True) - weights * slope
    remaining = total - weights
    signed = np.where(remaining > 0, np.sign(others), 0.0)
    counts = total[..., 0]
    seeds = (weights > 0).sum(-1)
    size = (weights * slope * signed).sum(-1) / np.where(counts > 0, counts, 1.0)
    star = mean_over_settings(np.where(seeds > 1, size, np.nan), rows)
    mean = (weights * slope).sum(-1) / np.where(counts > 0, counts, 1.0)
    usable = seeds > 1
    mean = np.where(usable, mean, 0.0)
    between = mean_over_settings(cross_mean(slope, slope, weights), rows)
    return star, between - cross_mean(mean, mean, rows * usable)


# `sensitivity.csv`: the effect of each key on a response, and that of the noise.


COLUMNS = ("response", "key", "statistic", "value", "low", "high", "level", "n", "distinct")
Rows = list[dict[str, Any]]


def sensitivity(
    runs: Runs, design: pd.DataFrame, settings: StudySettings, contrasts: list[Contrast], rng: np.random.Generator
) -> pd.DataFrame:
    """Rows of one response, noise last; `distinct` where the interval lies above 0.

    Empty where a run did not reach the response: an infinite value has no variance.
    """
    if not runs.reached or runs.replicates < 2 or np.isnan(runs.array).all():
        return pd.DataFrame(columns=list(COLUMNS))
    values, kind = runs.array, settings.design.analysis
    keys = [factor.key for factor in settings.factors]
    rows: Rows = []
    if kind == "sobol":
        names = [(key, statistic) for statistic in ("S1", "ST") for key in keys]
        rows += _rows(names, indices(values, len(keys), rng), len(values))
    elif kind == "morris":
        shares = design[[SHARE + key for key in keys]].to_numpy()
        names = [(key, statistic) for statistic in ("mu_star", "sigma") for key in keys]
        rows += _rows(names, effects(values, shares, rng), len(values))
    elif complete_seeds(values).shape[1] >= 2:
        rows += _variances(values, design, settings, contrasts, rng)
    group = {"sobol": len(keys) + 2, "morris": len(keys) + 1, "latin_hypercube": 1}.get(kind, 0)
    noise = noise_share(_ends(values, group), 2, rng) if kind == "sobol" else noise_share(values, group, rng)
    rows += _rows([("", "noise_share")], noise, len(values))
    frame = pd.DataFrame(rows).assign(response=runs.response)
    frame["distinct"] = frame["low"] > 0.0
    return frame.reindex(columns=list(COLUMNS))


def _variances(
    values: Array, design: pd.DataFrame, settings: StudySettings, contrasts: list[Contrast], rng: np.random.Generator
) -> Rows:
    """Shares of variance; seeds that failed at any setting are left out."""
    kind = settings.design.analysis
    if kind == "factorial":
        names, shares = factorial_shares(values, contrasts, rng)
    elif kind == "latin_hypercube":
        names = [factor.key for factor in settings.factors]
        shares = surface_shares(values, design, settings.factors, rng)
    else:
        names = [contrast.key for contrast in contrasts]
        parts = [key_shares(values, contrast, rng) for contrast in contrasts]
        value, low, high = (
            np.concatenate([getattr(part, side) for part in parts]) for side in ("value", "low", "high")
        )
        shares = Estimates(value, low, high)
    return _rows([(name, "anova_share") for name in names], shares, complete_seeds(values).shape[1])


def _ends(values: Array, group: int) -> Array:
    """A and B of a Sobol design, whose settings are a plain sample."""
    blocks = values.reshape(-1, group, values.shape[1])
    return blocks[:, [0, -1]].reshape(-1, values.shape[1])


def _rows(names: list[tuple[str, str]], estimates: Estimates, n: int) -> Rows:
    sides = zip(names, estimates.value, estimates.low, estimates.high, strict=True)
    return [
        {"key": key, "statistic": name, "value": value, "low": low, "high": high, "n": n, "level": estimates.level}
        for (key, name), value, low, high in sides
    ]
