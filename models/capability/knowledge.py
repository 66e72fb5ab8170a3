"""What a sample of parts tells of the process that made them: scatter, mean, and how surely."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]
LEAST = 5
"""Parts from which a sample is used; the posterior mean of a variance needs 4 of them."""
CONFIDENCE = 0.95
"""Confidence of the upper limit on a variance in an assured allocation."""


@dataclass(frozen=True, slots=True)
class Gauge:
    """A gauge: standard deviation of its readings, and the degrees of freedom of that estimate."""

    sigma: float
    df: float = np.inf


@dataclass(frozen=True, slots=True)
class Prior:
    """What is believed of a standard deviation before parts are measured, worth `parts` parts."""

    sigma: float
    parts: float


@dataclass(frozen=True, slots=True)
class Knowledge:
    """Posterior of a normal process: variance scaled-inverse-chi-square (df, std^2), mean given the
    variance normal about the sample's with variance sigma^2/n.

    `inflation` is E, the posterior mean of the variance over std^2, `surplus` is G, its upper limit
    at `CONFIDENCE` over std^2, less E. A known process has infinite `n` and `df`.

    Reference: Gelman et al. (2013), Bayesian Data Analysis, 3rd ed., section 3.3, with the prior
    density 1/sigma^2 or a scaled-inverse-chi-square one.
    """

    mean: float
    std: float
    n: float = np.inf
    df: float = np.inf
    inflation: float = 1.0
    surplus: float = 0.0


def knowledge_of(
    values: Array, prior: Prior | None = None, gauge: Gauge | None = None
) -> Knowledge:
    """What `values` (n,) of one characteristic tell.

    The variance of a gauge is subtracted, and the upper limit that of the difference. Raises
    ValueError for fewer than `LEAST` values, values that are all equal, and a gauge that scatters
    at least as much as the readings.
    """
    n = len(values)
    if n < LEAST:
        raise ValueError(f"has {n} values, {LEAST} at least are needed")
    seen, mean = float(np.var(values, ddof=1)), float(np.mean(values))
    if seen <= 0.0:
        raise ValueError(f"has {n} equal values: the resolution of the gauge is too coarse to tell "
                         "a scatter")  # fmt: skip
    own = seen if gauge is None else seen - gauge.sigma**2
    if gauge is not None and own <= 0.0:
        raise ValueError(f"scatters by {np.sqrt(seen):.4g}, its gauge alone by {gauge.sigma:.4g}: "
                         "the gauge is unfit for these parts")  # fmt: skip
    df = n - 1.0
    surplus_of_gauge = 0.0
    if gauge is not None:
        limit = upper_of_difference(seen, df, gauge.sigma**2, gauge.df)
        surplus_of_gauge = limit / own - df / float(scipy.stats.chi2.ppf(1.0 - CONFIDENCE, df))
    if prior is not None:
        own = (prior.parts * prior.sigma**2 + df * own) / (prior.parts + df)
        df += prior.parts
    inflation = df / (df - 2.0)
    surplus = df / float(scipy.stats.chi2.ppf(1.0 - CONFIDENCE, df)) - inflation
    surplus += max(surplus_of_gauge, 0.0)
    return Knowledge(mean, float(np.sqrt(own)), float(n), df, inflation, surplus)


def upper_of_difference(
    first: float, first_df: float, second: float, second_df: float, confidence: float = CONFIDENCE
) -> float:
    """Upper confidence limit of the difference of two variances, from their estimates.

    Reference: Ting, Burdick, Graybill, Jeyaratnam, Lu (1990), Confidence intervals on linear
    combinations of variance components that are unrestricted in sign, J. Statistical Computation
    and Simulation 35(1-2), 135-143.
    """
    if second <= 0.0:
        return first * first_df / float(scipy.stats.chi2.ppf(1.0 - confidence, first_df))
    above = first_df / float(scipy.stats.chi2.ppf(1.0 - confidence, first_df)) - 1.0
    if np.isfinite(second_df):
        below = 1.0 - second_df / float(scipy.stats.chi2.ppf(confidence, second_df))
        f = float(scipy.stats.f.ppf(1.0 - confidence, first_df, second_df))
    else:
        below = 0.0
        f = float(scipy.stats.chi2.ppf(1.0 - confidence, first_df)) / first_df
    mixed = ((1.0 - f) ** 2 - (above * f) ** 2 - below**2) / f
    variance = (above * first) ** 2 + (below * second) ** 2 + mixed * first * second
    return first - second + float(np.sqrt(max(variance, 0.0)))
