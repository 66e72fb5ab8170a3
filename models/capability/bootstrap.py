"""Confidence that sums of parts, normal or not, conform to their limits: Bayesian bootstrap.

Every draw weights the measured values of each part (Dirichlet), takes the moments of the weighted
sample, adds the cumulants up and compares the quantiles of the sum (Cornish & Fisher) with the
limits.

Reference: Rubin (1981), The Bayesian bootstrap, Annals of Statistics 9(1), 130-134; Cornish &
Fisher (1938), Revue de l'Institut International de Statistique 5(4), 307-320.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtri

from ...arrays import Array
from ..propagation.moments import cornish_fisher


def cumulants_drawn(values: Array, draws: int, rng: np.random.Generator) -> Array:
    """Mean and second to fourth cumulants (draws, 4) of values (n,) about their mean, weighted.

    The variance is (n + 1)/(n - 1) times that of the weighted sample, so that its mean is the
    sample's variance.
    """
    n, centred = len(values), values - values.mean()
    weights = rng.dirichlet(np.ones(n), draws)
    mean = weights @ centred
    about = centred[None, :] - mean[:, None]
    second, third, fourth = (np.sum(weights * about**k, axis=1) for k in (2, 3, 4))
    wider = (n + 1.0) / (n - 1.0)
    return np.stack([mean, second * wider, third * wider**1.5, (fourth - 3.0 * second**2) * wider**2], axis=1)


def fraction_within_limits(cumulants: Sequence[Array], ends: tuple[float, float], fraction: float) -> float:
    """Fraction of the draws in which the sum of parts conforms to its limits.

    `cumulants` (draws, 4) are those of each part, `ends` the limits of the sum from its estimated
    mean. A draw conforms where the limits contain the `fraction` of the units, with equal fractions
    beyond each finite limit.
    """
    mean, variance, third, fourth = np.sum(cumulants, axis=0).T
    std = np.sqrt(np.maximum(variance, 1e-300))
    skew, excess = third / std**3, fourth / std**4
    finite = np.isfinite(ends)
    z = float(ndtri(0.5 * (1.0 + fraction) if np.all(finite) else fraction))
    within = np.ones(len(mean), dtype=bool)
    for side, end, limited in zip((-1.0, 1.0), ends, finite, strict=True):
        if limited:
            within &= side * (end - mean) >= side * std * cornish_fisher(side * z, skew, excess)
    return float(within.mean())
