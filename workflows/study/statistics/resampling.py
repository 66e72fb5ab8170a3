"""Estimates that the noise of the runs does not inflate, and their intervals.

A product of two values of one setting is taken over two different seeds, so that the noise of a run
never multiplies itself: mean over r != s of a_r b_s is free of bias whatever the noise. Intervals
come from a Bayesian bootstrap (Rubin 1981) of settings and of seeds; where both are a sample, the
variances add, less that of the single runs, which is in both (Cameron, Gelbach, Miller 2011).
Settings of a Sobol sequence are better than a random sample: their part comes from a jackknife over
parts of the design that were scrambled apart from each other (Owen 2013, Monte Carlo theory, 17.3).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import t

from ....arrays import Array

Statistic = Callable[[Array, Array], Array]
"""From weights of the settings (draws, settings) and of the runs (draws, settings or 1, replicates)
to estimates (draws, statistics)."""
LEVEL = 0.95
DRAWS = 400
BLOCK = 2_000_000
"""Weights that are drawn at a time."""


@dataclass(frozen=True, slots=True)
class Estimates:
    """Values with their intervals, each of shape (statistics,)."""

    value: Array
    low: Array
    high: Array
    level: float = LEVEL


def crossed(a: Array, b: Array, weights: Array) -> Array:
    """Weighted mean of a_r b_s over all r != s of the last axis, NaN where there is no such pair.

    A weight of 0 leaves a run out; its values must be finite all the same.
    """
    squares = weights**2
    both = _summed(weights, a) * _summed(weights, b) - _summed(squares, a * b)
    sum_of_squares = squares.sum(-1)
    pairs = weights.sum(-1) ** 2 - sum_of_squares
    usable = pairs > 1e-9 * np.maximum(sum_of_squares, 1e-300)
    return np.where(usable, both / np.where(usable, pairs, 1.0), np.nan)


def _summed(weights: Array, values: Array) -> Array:
    """Weighted sum over the last axis, without the array of products."""
    return np.asarray(np.einsum("...r,...r->...", weights, values))


def over_settings(values: Array, weights: Array) -> Array:
    """Weighted mean over the last axis without NaN; NaN where no value remains."""
    known = ~np.isnan(values)
    total = (weights * known).sum(-1)
    summed = (weights * np.where(known, values, 0.0)).sum(-1)
    return np.where(total > 0, summed / np.where(total > 0, total, 1.0), np.nan)


def fraction_of(parts: Array, total: Array) -> Array:
    """Parts (draws, statistics) over totals (draws,), 0 where nothing varies."""
    return np.divide(parts, total[:, None], out=np.zeros_like(parts), where=total[:, None] > 0.0)


def random_settings(
    statistic: Statistic, settings: int, replicates: int, rng: np.random.Generator, parts: int = 0, level: float = LEVEL
) -> Estimates:
    """Estimates where the settings are a sample (blocks of a Sobol design, trajectories).

    Each of `parts` equal parts in a row is a sample that is independent of the others.
    """
    value, flat = _value(statistic, settings, replicates)
    all_runs = np.ones((1, 1, replicates))
    if parts:
        leave_one_out = np.repeat(1.0 - np.eye(parts), settings // parts, axis=1)
        rows = np.asarray((parts - 1) * statistic(leave_one_out, all_runs).var(axis=0))
    else:
        rows = _spread(lambda n: statistic(rng.exponential(size=(n, settings)), all_runs), settings)
    seeds = _spread(lambda n: statistic(flat, rng.exponential(size=(n, 1, replicates))), replicates)
    runs = _spread(
        lambda n: statistic(flat, rng.exponential(size=(n, settings, replicates))),
        replicates,
        max(1, BLOCK // (settings * replicates)),
    )
    return _around(value, rows + np.maximum(seeds - runs, 0.0), (parts or settings) - 1, level)


def fixed_settings(statistic: Statistic, replicates: int, rng: np.random.Generator) -> Estimates:
    """Estimates for exactly the settings of the design; the seeds are the sample."""
    value, flat = _value(statistic, 1, replicates)
    variance = _spread(lambda n: statistic(flat, rng.exponential(size=(n, 1, replicates))), replicates)
    return _around(value, variance, replicates - 1)


def _value(statistic: Statistic, settings: int, replicates: int) -> tuple[Array, Array]:
    flat = np.ones((1, settings))
    return statistic(flat, np.ones((1, 1, replicates)))[0], flat


def _spread(draw: Callable[[int], Array], units: int, block: int = DRAWS) -> Array:
    """Variance over the draws, as of a mean of `units` independent values."""
    counts = np.diff(np.append(np.arange(0, DRAWS, min(block, DRAWS)), DRAWS))
    estimates = np.concatenate([draw(int(n)) for n in counts])
    if units < 2:
        return np.full(estimates.shape[1], np.nan)
    # Weights of a Dirichlet distribution spread a mean by (n - 1) / (n + 1) of its variance.
    return np.asarray(estimates.var(axis=0) * (units + 1) / (units - 1))


def _around(value: Array, variance: Array, freedom: int, level: float = LEVEL) -> Estimates:
    half = t.ppf(0.5 + level / 2, max(freedom, 1)) * np.sqrt(variance)
    return Estimates(value, value - half, value + half, level)
