"""What instruments add to a reading."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from benchmarks.gap.generator.tables import Array, Points


def white(rng: np.random.Generator, at: Points) -> Array:
    return rng.normal(size=len(at))


def autocorrelated(rng: np.random.Generator, at: Points) -> Array:
    """AR(1) with 0.7 in the order of measuring, variance 1."""
    shocks = rng.normal(size=len(at) + 50) * np.sqrt(1.0 - 0.49)
    return np.asarray(lfilter([1.0], [1.0, -0.7], shocks)[50:])


def heteroscedastic(rng: np.random.Generator, at: Points) -> Array:
    """A scatter that grows with the load, the speed, the reach or the time, rms 1."""
    ways = at.scatter_follows
    by = ways[rng.integers(len(ways))]
    size = 0.3 + rng.uniform(1.0, 3.0) * by / by.max()
    return np.asarray(rng.normal(size=len(at)) * size / np.sqrt(np.mean(size**2)))


def outliers(rng: np.random.Generator, at: Points) -> Array:
    """2 % of readings are wrong by 8 to 20 standard deviations."""
    found: Array = rng.normal(size=len(at))
    bad = rng.random(len(at)) < 0.02
    found[bad] += rng.choice([-1.0, 1.0], bad.sum()) * rng.uniform(8.0, 20.0, bad.sum())
    return found


NOISES: dict[str, Callable[[np.random.Generator, Points], Array]] = {
    "white": white,
    "autocorrelated": autocorrelated,
    "heteroscedastic": heteroscedastic,
    "outliers": outliers,
    "quantised": white,  # the whole reading is rounded afterwards
}
