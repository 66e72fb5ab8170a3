"""Propagation by the first four cumulants: fast, approximate in the tails."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np
from scipy.special import ndtr, ndtri

from ...arrays import Array
from ..inputs.normal import density
from .method import Propagation
from .result import Estimate, Propagated
from .sums import ClippedSum, cumulants_of, total_cumulants

TINY = 1e-75
"""Replaces a spread of 0: its fourth power, which divides a fourth cumulant, is still above 0."""


@dataclass(frozen=True, slots=True)
class Moments(Propagation):
    """Cumulants add; the clip at zero, the quantile and the probabilities follow from a series.

    The clipped part has the Gram-Charlier density of its four cumulants, the quantile is that of
    Cornish & Fisher (1937), the probabilities come from the Edgeworth series. The stated error is
    the difference between the series with and without its third and fourth cumulants: an estimate,
    not a bound. References: Abramowitz & Stegun 26.2; Johnson, Kotz & Balakrishnan, ch. 12.
    """

    @property
    def block(self) -> int:
        return 16_384

    def _propagate(self, total: ClippedSum, coverage: float, limit: float) -> Propagated:
        clipped, free = total_cumulants(total.clipped), total_cumulants(total.free)
        ends = _ends(total)
        full = _within(_effective(clipped, free, coverage, limit), ends)
        gauss = _within(_effective(_gaussian(clipped), free, coverage, limit, True), ends)
        doubt = _doubt(clipped, free, coverage)
        estimates = [Estimate(a, np.abs(a - b) + c) for a, b, c in zip(full, gauss, doubt, strict=True)]
        mean, variance = clipped[:2] + free[:2]
        return Propagated(mean, np.sqrt(variance), *estimates)


def _ends(total: ClippedSum) -> tuple[Array, Array]:
    """Least and largest effective value (n,)."""
    free, clipped = ([t.bounds() for t in terms] for terms in (total.free, total.clipped))
    low, high = (
        np.sum([ends[at] for ends in free], axis=0) + np.maximum(np.sum([ends[at] for ends in clipped], axis=0), 0.0)
        for at in (0, 1)
    )
    return low, high


def _within(moments: tuple[Array, ...], ends: tuple[Array, Array]) -> tuple[Array, ...]:
    """Mean and quantile moved into the support: a series may leave it where most mass is cut."""
    mean, std, quantile, *rest = moments
    return (np.clip(mean, *ends), std, np.clip(quantile, *ends), *rest)


def _gaussian(cumulants: Array) -> Array:
    """The same mean and variance, without third and fourth cumulant."""
    return np.asarray(cumulants * np.array([1.0, 1.0, 0.0, 0.0])[:, None])


def _doubt(clipped: Array, free: Array, coverage: float) -> tuple[Array, ...]:
    """Estimated error of the series, whatever its terms cancel to, per statistic.

    The size of the terms with the largest Hermite polynomials times density instead of those at the
    evaluated point: 0.40, 0.55 and 1.4 for the orders 2, 3 and 5.
    """
    effective = cumulants_of(_upper_moments(clipped)[1:]) + free
    of_clipped, of_sum = _series_size(clipped), _series_size(effective)
    sigma, std = np.sqrt(clipped[1]), np.sqrt(np.maximum(effective[1], 0.0))
    stretch = 1.0 / float(density(np.asarray(ndtri(coverage))))
    tail = np.minimum(of_sum * stretch, 1.5) * std
    return of_clipped * sigma, of_clipped * sigma, tail, np.minimum(of_sum + of_clipped, 1.0), of_clipped


def _series_size(cumulants: Array) -> Array:
    sigma = np.sqrt(np.maximum(cumulants[1], TINY**2))
    with np.errstate(over="ignore"):  # where the series gives no variance its error is unbounded
        skew, excess = np.abs(cumulants[2]) / sigma**3, np.abs(cumulants[3]) / sigma**4
        return np.asarray(0.40 * skew / 6.0 + 0.55 * excess / 24.0 + 1.4 * skew**2 / 72.0)


def _effective(
    clipped: Array, free: Array, coverage: float, limit: float, gaussian: bool = False
) -> tuple[Array, Array, Array, Array, Array]:
    """Mean, std, quantile, conforming and negative probability of free + max(0, clipped)."""
    upper = _upper_moments(clipped)
    cumulants = cumulants_of(upper[1:]) + free
    mean, std = cumulants[0], np.sqrt(np.maximum(cumulants[1], 0.0))
    safe = np.maximum(std, TINY)
    spread = np.where(std > 0.0, cumulants, 0.0)
    skew, excess = spread[2] / safe**3, spread[3] / safe**4
    if gaussian:
        skew, excess = np.zeros_like(skew), np.zeros_like(excess)
    quantile = mean + std * cornish_fisher(float(ndtri(coverage)), skew, excess)
    conforming = _edgeworth((limit - mean) / safe, skew, excess)
    return mean, std, quantile, conforming, np.clip(1.0 - upper[0], 0.0, 1.0)


def _upper_moments(cumulants: Array) -> Array:
    """E[x^k; x > 0], k = 0..4, of the Gram-Charlier density, shape (5, n)."""
    mean = cumulants[0]
    sigma = np.maximum(np.sqrt(cumulants[1]), 1e-12 * np.abs(mean) + TINY)
    skew, excess = cumulants[2] / sigma**3 / 6.0, cumulants[3] / sigma**4 / 24.0
    tail = _normal_tail_moments(-mean / sigma, 8)
    shaped = [
        tail[j] + skew * (tail[j + 3] - 3.0 * tail[j + 1]) + excess * (tail[j + 4] - 6.0 * tail[j + 2] + 3.0 * tail[j])
        for j in range(5)
    ]
    means, scaled = _powers(mean), [a * b for a, b in zip(_powers(sigma), shaped, strict=True)]
    return np.array([sum(comb(k, j) * means[k - j] * scaled[j] for j in range(k + 1)) for k in range(5)])


def _powers(x: Array) -> list[Array]:
    """x^0 .. x^4 by multiplication: a general power takes twenty times as long."""
    powers = [np.ones_like(x)]
    for _ in range(4):
        powers.append(powers[-1] * x)
    return powers


def _normal_tail_moments(start: Array, order: int) -> list[Array]:
    """Integrals of z^j phi(z) from `start` to infinity, j = 0 .. order."""
    peak = density(start)
    moments = [ndtr(-start), peak]
    power = np.ones_like(start)
    for j in range(2, order + 1):
        power = power * start
        moments.append(power * peak + (j - 1) * moments[j - 2])
    return moments


def cornish_fisher(z: float, skew: Array, excess: Array) -> Array:
    """Quantile (n,) of a standardised variable with these cumulants (n,), at the normal z."""
    bend = (2.0 * z**3 - 5.0 * z) * skew**2 / 36.0
    return z + (z**2 - 1.0) * skew / 6.0 + (z**3 - 3.0 * z) * excess / 24.0 - bend


def _edgeworth(x: Array, skew: Array, excess: Array) -> Array:
    x = np.clip(x, -40.0, 40.0)
    square = x * x
    second, third = square - 1.0, x * (square - 3.0)
    fifth = x * (square * (square - 10.0) + 15.0)
    series = skew * second / 6.0 + excess * third / 24.0 + skew**2 * fifth / 72.0
    return np.clip(ndtr(x) - density(x) * series, 0.0, 1.0)
