"""Choices by the weights of the objectives (n, m), all of them minimised."""

from __future__ import annotations

import numpy as np

from ...arrays import Array


def by_pseudo_weights(values: Array, weights: Array) -> int | None:
    """The point whose pseudo-weights are nearest to `weights` (m,), which add up to one.

    Reference: Deb (2001), Multi-objective optimization using evolutionary algorithms, section
    8.7.2. None where an objective does not vary: a pseudo-weight is not defined then.
    """
    span = np.ptp(values, axis=0)
    if not np.all(span > 0.0):
        return None
    # pymoo's own class imports a name of scipy that is deprecated
    gained = (values.max(axis=0) - values) / span
    pseudo_weights = gained / gained.sum(axis=1, keepdims=True)
    return int(np.argmin(np.abs(pseudo_weights - weights).sum(axis=1)))


def closeness(values: Array, weights: Array) -> Array:
    """TOPSIS: closeness (n,) to the ideal, between 0 and 1.

    Reference: Hwang & Yoon (1981), Multiple attribute decision making, with their vector
    normalisation. A criterion that is better when larger enters with its sign reversed.
    """
    lengths = np.linalg.norm(values, axis=0)
    rated = weights * values / np.where(lengths > 0.0, lengths, 1.0)
    to_best = np.linalg.norm(rated - rated.min(axis=0), axis=1)
    to_worst = np.linalg.norm(rated - rated.max(axis=0), axis=1)
    whole = to_best + to_worst
    return np.asarray(np.divide(to_worst, whole, out=np.ones_like(whole), where=whole > 0.0))


def by_topsis(values: Array, weights: Array) -> int | None:
    """The point closest to the ideal by TOPSIS."""
    return int(np.argmax(closeness(values, weights)))
