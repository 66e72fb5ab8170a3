"""Shares of the variance of one run, noise included: the fraction that each key explains.

They are estimated over pairs of different seeds, so that noise adds nothing to the share of a key.
The settings are those of the design; the intervals are over seeds.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pandas as pd

from ....arrays import Array
from ..records import Factor
from .anova import model
from .contrasts import Contrast
from .noise import variance
from .resampling import Estimates, crossed, fixed_settings, fraction_of
from .runs import complete


def effect_of(values: Array, weights: Array) -> Array:
    """Variance of the levels (levels, replicates) without the noise; shape (draws,)."""
    return _squares(values - values.mean(axis=0), weights)


def key_shares(values: Array, contrast: Contrast, rng: np.random.Generator) -> Estimates:
    """One at a time: share of one key in the variance of a run over its levels, shape (1,)."""
    levels = complete(contrast.table(values).T)

    def statistic(rows: Array, weights: Array) -> Array:
        effect = effect_of(levels, weights)
        return fraction_of(effect[:, None], effect + variance(levels, weights).mean(-1))

    return fixed_settings(statistic, levels.shape[1], rng)


def factorial_shares(values: Array, contrasts: list[Contrast], rng: np.random.Generator) -> tuple[list[str], Estimates]:
    """Shares of every key and every pair of keys, and their names."""
    whole = complete(values)
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
    return np.asarray(crossed(values, values, weights).mean(-1))


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
    whole = complete(values)
    models = [model(design, tuple(other for other in factors if other is not omitted)) for omitted in (None, *factors)]
    parts = [np.linalg.qr(columns)[0] for columns in models]

    def statistic(rows: Array, weights: Array) -> Array:
        between = effect_of(whole, weights)
        explained = [crossed(q.T @ whole, q.T @ whole, weights).sum(-1) for q in parts]
        gains = np.stack([explained[0] - part for part in explained[1:]], axis=-1) / len(whole)
        return fraction_of(gains, between + variance(whole, weights).mean(-1))

    return fixed_settings(statistic, whole.shape[1], rng)
