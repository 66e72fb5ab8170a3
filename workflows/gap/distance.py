"""The distance of a batch from the population that a model predicts.

The gap of a batch is a distance between distributions: the root mean square of the differences of
the sorted units from the quantiles of the population at their ranks. This is the 2-Wasserstein
distance between the batch and the population, in the output's unit.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Array
from ...models.effects.population.law import Law

BATCHES = 400
"""Simulated batches from which the floor is computed."""
FLOOR = 0.95
"""Fraction of the batches of a population whose distance from it is at most the floor."""


def distance(law: Law, units: Array) -> float:
    """The distance between deviations (n,) of units from the model's mean and their law."""
    return float(_distances(law, np.asarray(units)[None])[0])


def floor(
    law: Law, count: int, rng: np.random.Generator, fraction: float = FLOOR, centred: bool = False, scaled: bool = False
) -> float:
    """The quantile `fraction` of the distances of batches of `count` units, drawn from the law;
    `centred`: about the mean of each batch; `scaled`: with the width of the law as well.
    """
    drawn = law.histogram.rvs(size=(BATCHES, count), random_state=rng)
    drawn = matched(law, drawn, scaled) if centred else drawn
    return float(np.quantile(_distances(law, drawn), fraction))


def matched(law: Law, units: Array, scaled: bool = False) -> Array:
    """Units (..., n) moved to the mean of the law, and stretched to its width if `scaled`."""
    about = units - units.mean(axis=-1, keepdims=True)
    if scaled:
        about *= law.histogram.std() / units.std(axis=-1, keepdims=True)
    return np.asarray(about + law.histogram.mean())


def likelier(x: Array, low: float, step: float, ratios: Array) -> Array:
    """Twice the largest log likelihood ratio (b,), at least 0, of batches x (b, n), from the ratios
    (m, k) at a lattice `low` + k `step`. Units are counted in its cells, so that a likelihood is a
    matrix product.
    """
    size = ratios.shape[1]
    cell = np.clip(np.rint((x - low) / step), 0, size - 1).astype(np.int64)
    cell += size * np.arange(len(x))[:, None]
    counts = np.bincount(cell.ravel(), minlength=size * len(x)).reshape(len(x), size)
    return np.asarray(2.0 * (counts.astype(float) @ ratios.T).max(axis=1).clip(0.0))


def _distances(law: Law, units: Array) -> Array:
    """The distances (m,) of batches (m, n) from a law."""
    ranks = (np.arange(units.shape[1]) + 0.5) / units.shape[1]
    apart = np.sort(units, axis=1) - law.histogram.ppf(ranks)
    return np.asarray(np.sqrt(np.mean(apart**2, axis=1)))
