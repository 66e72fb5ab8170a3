"""Inference from a sample of parts on the process: scatter, mean, and their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from ...arrays import Array

LEAST = 5
"""Parts from which a sample is used; the posterior mean of a variance needs 4 of them."""
CONFIDENCE = 0.95
"""Confidence of the upper limit on a variance in an assured allocation."""
CONTRADICTED = 1e-6
"""Probability below which a sample contradicts a prior."""


@dataclass(frozen=True, slots=True)
class Gauge:
    """A gauge: its standard deviation, and the degrees of freedom of that estimate."""

    sigma: float
    df: float = np.inf


@dataclass(frozen=True, slots=True)
class Prior:
    """A prior of a standard deviation, with the weight of `parts` measured parts."""

    sigma: float
    parts: float


@dataclass(frozen=True, slots=True)
class Difference:
    """The variances of measurements and gauge; that of the parts is their difference.

    Each is an estimate with its degrees of freedom.
    """

    measured: float
    measured_df: float
    gauge: float
    gauge_df: float

    @property
    def part_variance(self) -> float:
        """The variance of the parts alone."""
        return self.measured - self.gauge


@dataclass(frozen=True, slots=True)
class Knowledge:
    """Posterior of a normal process: variance scaled-inverse-chi-square (df, std^2), mean given the
    variance normal about the sample's with variance sigma^2/n.

    A known process has infinite `n` and `df`. `prior_parts` is the weight of a stated
    prior, in parts; `difference` holds the variances where a gauge adds uncertainty.

    Reference: Gelman et al. (2013), Bayesian Data Analysis, 3rd ed., section 3.3, with the prior
    density 1/sigma^2 or a scaled-inverse-chi-square one.
    """

    mean: float
    std: float
    n: float = np.inf
    df: float = np.inf
    prior_parts: float = 0.0
    difference: Difference | None = None

    @property
    def inflation(self) -> float:
        """E, the posterior mean of the variance over std^2."""
        return 1.0 if np.isinf(self.df) else self.df / (self.df - 2.0)

    @property
    def surplus(self) -> float:
        """`surplus_at` the usual confidence."""
        return self.surplus_at(CONFIDENCE)

    def surplus_at(self, confidence: float) -> float:
        """G, the upper limit of the variance at a confidence over std^2, less E; at least 0."""
        if np.isinf(self.df):
            return 0.0
        surplus = _factor(self.df, confidence) - self.inflation
        if (difference := self.difference) is not None:
            limit = upper_of_difference(
                difference.measured, difference.measured_df, difference.gauge, difference.gauge_df, confidence
            )
            surplus += max(limit / difference.part_variance - _factor(difference.measured_df, confidence), 0.0)
        return max(surplus, 0.0)

    def drawn(self, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """Variances over std^2 and errors of the mean over std, (count,) each, of the posterior.

        With a gauge, the generalised pivotal quantity of the difference is drawn: a drawn variance
        of the gauge is subtracted from that of the measurements; the difference is at least a
        thousandth.
        Reference: Weerahandi (1993), Generalized confidence intervals, J. American Statistical
        Association 88(423), 899-905.
        """
        if np.isinf(self.df):
            return np.ones(count), np.zeros(count)
        variance = self.df / rng.chisquare(self.df, count)
        observed = variance
        if (difference := self.difference) is not None:
            fraction = difference.measured_df / self.df
            gauge = np.full(count, difference.gauge)
            if np.isfinite(difference.gauge_df):
                gauge = difference.gauge * difference.gauge_df / rng.chisquare(difference.gauge_df, count)
            measured = variance * (self.std**2 + fraction * difference.gauge)
            variance = np.maximum(measured - fraction * gauge, 1e-3 * self.std**2) / self.std**2
            observed = variance + gauge / self.std**2
        return variance, np.sqrt(observed / self.n) * rng.standard_normal(count)


def _factor(df: float, confidence: float) -> float:
    """The upper confidence limit of a variance over its estimate."""
    return df / float(scipy.stats.chi2.ppf(1.0 - confidence, df))


def knowledge_of(values: Array, prior: Prior | None = None, gauge: Gauge | None = None) -> Knowledge:
    """The posterior of a process from measured `values` (n,) of a characteristic.

    The variance of a gauge is subtracted, and the upper limit is that of the difference. Raises
    ValueError for fewer than `LEAST` values, values that are all equal, a gauge that scatters
    at least as much as the measurements, and a prior that they contradict.
    """
    n = len(values)
    if n < LEAST:
        raise ValueError(f"has {n} values; at least {LEAST} are needed")
    observed, mean = float(np.var(values, ddof=1)), float(np.mean(values))
    if observed <= 0.0:
        raise ValueError(f"has {n} equal values: the resolution of the gauge is too coarse to show a scatter")
    variance = observed if gauge is None else observed - gauge.sigma**2
    if gauge is not None and variance <= 0.0:
        raise ValueError(
            f"has a standard deviation of {np.sqrt(observed):.4g}, its gauge alone one of {gauge.sigma:.4g}: "
            "the gauge is unfit for these parts"
        )
    df, parts = n - 1.0, 0.0
    difference = None if gauge is None else Difference(observed, df, gauge.sigma**2, gauge.df)
    if prior is not None:
        _check_prior(variance, df, prior)
        variance = (prior.parts * prior.sigma**2 + df * variance) / (prior.parts + df)
        df, parts = df + prior.parts, prior.parts
    return Knowledge(mean, float(np.sqrt(variance)), float(n), df, parts, difference)


def _check_prior(variance: float, df: float, prior: Prior) -> None:
    """Raises ValueError where a sample contradicts a prior."""
    below = float(scipy.stats.f.cdf(variance / prior.sigma**2, df, prior.parts))
    chance = 2.0 * min(below, 1.0 - below)
    if chance < CONTRADICTED:
        raise ValueError(
            f"has a standard deviation of {np.sqrt(variance):.4g}, the prior one of {prior.sigma:.4g} with the weight "
            f"of {prior.parts:g} parts: they differ as much by chance once in {1.0 / max(chance, 1e-12):.2g} samples; "
            "reduce prior.parts, or remove the prior"
        )


def upper_of_difference(
    first: float, first_df: float, second: float, second_df: float, confidence: float = CONFIDENCE
) -> float:
    """Upper confidence limit of the difference of two variances, from their estimates.

    Reference: Ting, Burdick, Graybill, Jeyaratnam, Lu (1990), Confidence intervals on linear
    combinations of variance components that are unrestricted in sign, J. Statistical Computation
    and Simulation 35(1-2), 135-143.
    """
    chi_square = float(scipy.stats.chi2.ppf(1.0 - confidence, first_df))
    if second <= 0.0:
        return first * first_df / chi_square
    above = first_df / chi_square - 1.0
    if np.isfinite(second_df):
        below = 1.0 - second_df / float(scipy.stats.chi2.ppf(confidence, second_df))
        f = float(scipy.stats.f.ppf(1.0 - confidence, first_df, second_df))
    else:
        below, f = 0.0, chi_square / first_df
    mixed = ((1.0 - f) ** 2 - (above * f) ** 2 - below**2) / f
    variance = (above * first) ** 2 + (below * second) ** 2 + mixed * first * second
    return first - second + float(np.sqrt(max(variance, 0.0)))
