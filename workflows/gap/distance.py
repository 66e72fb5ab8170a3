"""How far a batch is from the population that a model says it comes from.

The gap of a batch is one between distributions: the root mean square of the distances of the units,
in the order of their size, from the quantiles of the population at their ranks. This is the
2-Wasserstein distance between the batch and the population, in the output's unit.
"""

from __future__ import annotations

import numpy as np

from ...models.inputs.distribution import Array
from .law import Law

BATCHES = 400
"""Simulated batches that the floor is read from."""
FLOOR = 0.95
"""Share of the batches of a population that are as close to it as its floor, or closer."""


def distance(law: Law, units: Array) -> float:
    """Between deviations (n,) of units from the model's mean, and their law."""
    return float(_distances(law, np.asarray(units)[None])[0])


def floor(
    law: Law, count: int, rng: np.random.Generator, share: float = FLOOR, centred: bool = False
) -> float:
    """Distance that a share of the batches of `count` units, drawn from the law, stay below;
    `centred`: about the mean of each batch.
    """
    drawn = law.histogram.rvs(size=(BATCHES, count), random_state=rng)
    if centred:
        drawn -= drawn.mean(axis=1, keepdims=True)
    return float(np.quantile(_distances(law, drawn), share))


def _distances(law: Law, units: Array) -> Array:
    """Of batches (m, n)."""
    ranks = (np.arange(units.shape[1]) + 0.5) / units.shape[1]
    apart = np.sort(units, axis=1) - law.histogram.ppf(ranks)
    return np.asarray(np.sqrt(np.mean(apart**2, axis=1)))
