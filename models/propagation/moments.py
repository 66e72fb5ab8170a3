"""Propagation by the first four cumulants: fast, approximate in the tails."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import comb, sqrt

import numpy as np
from scipy.special import ndtr, ndtri

from ...section import Array
from ..inputs import density
from .sums import ClippedSum, Estimate, Propagated, Propagation, cumulants_of, total_cumulants

MIN_STD = 1e-75
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
        full = _clip_to_support(_effective(clipped, free, coverage, limit), ends)
        gauss = _clip_to_support(_effective(_gaussian(clipped), free, coverage, limit, True), ends)
        doubt = _series_error(clipped, free, coverage)
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


def _clip_to_support(moments: tuple[Array, ...], ends: tuple[Array, Array]) -> tuple[Array, ...]:
    """Mean and quantile moved into the support: a series may leave it where most mass is cut."""
    mean, std, quantile, *rest = moments
    return (np.clip(mean, *ends), std, np.clip(quantile, *ends), *rest)


def _gaussian(cumulants: Array) -> Array:
    """The same mean and variance, without third and fourth cumulant."""
    return np.asarray(cumulants * np.array([1.0, 1.0, 0.0, 0.0])[:, None])


def _series_error(clipped: Array, free: Array, coverage: float) -> tuple[Array, ...]:
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
    sigma = np.sqrt(np.maximum(cumulants[1], MIN_STD**2))
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
    safe = np.maximum(std, MIN_STD)
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
    sigma = np.maximum(np.sqrt(cumulants[1]), 1e-12 * np.abs(mean) + MIN_STD)
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


# Mean, spread and capability of a sample, each with its standard error, from sums of powers.
#
# All errors are closed forms to first order in 1/sqrt(n) (delta method) and hold for any
# distribution with four moments; for a normal one they are the textbook sigma/sqrt(n),
# sigma/sqrt(2 n), and those of Bissell (1990), J. Royal Stat. Soc. C 39(3), 331-340, for Cp and Cpk.


@dataclass(frozen=True, slots=True)
class Stated:
    """A value and its standard error."""

    value: float
    error: float


@dataclass(frozen=True, slots=True)
class PowerSums:
    """Sums of (x - about)^k, k = 1..4, over `count` values; `about` near the mean saves digits."""

    count: int
    about: float
    first: float = 0.0
    second: float = 0.0
    third: float = 0.0
    fourth: float = 0.0

    def with_values(self, values: Array) -> PowerSums:
        """The same with more values (n,)."""
        d = values - self.about
        square = d * d
        return replace(
            self,
            count=self.count + len(values),
            first=self.first + float(d.sum()),
            second=self.second + float(d @ d),
            third=self.third + float(square @ d),
            fourth=self.fourth + float(square @ square),
        )

    def moments(self) -> tuple[float, float, float, float]:
        """Mean, unbiased variance, third and fourth central moment. Needs two values or more."""
        n = self.count
        m, a2, a3, a4 = (power / n for power in (self.first, self.second, self.third, self.fourth))
        second = a2 - m**2
        third = a3 - 3.0 * m * a2 + 2.0 * m**3
        fourth = a4 - 4.0 * m * a3 + 6.0 * m**2 * a2 - 3.0 * m**4
        return self.about + m, max(second, 0.0) * n / (n - 1), third, fourth

    @property
    def mean(self) -> Stated:
        """The mean; its error is s/sqrt(n)."""
        mean, variance, _, _ = self.moments()
        return Stated(mean, sqrt(variance / self.count))

    @property
    def std(self) -> Stated:
        """The standard deviation s; its error is sqrt((mu_4 - s^4)/(4 n s^2))."""
        _, variance, _, fourth = self.moments()
        return Stated(sqrt(variance), sqrt(_variance_of_std(variance, fourth) / self.count))

    def cp(self, lower: float, upper: float) -> Stated:
        """Capability (upper - lower)/(6 s)."""
        s = self.std
        value = (upper - lower) / (6.0 * s.value)
        return Stated(value, value * s.error / s.value)

    def to_limit(self, limit: float, side: int) -> Stated:
        """One-sided capability side (limit - mean)/(3 s): `side` +1 of an upper limit, -1 lower."""
        mean, variance, third, fourth = self.moments()
        s = sqrt(variance)
        value = side * (limit - mean) / (3.0 * s)
        by_mean, by_std = -side / (3.0 * s), -value / s
        square = by_mean**2 * variance + by_std**2 * _variance_of_std(variance, fourth)
        square += 2.0 * by_mean * by_std * 0.5 * third / s
        return Stated(value, sqrt(max(square, 0.0) / self.count))

    def cpk(self, lower: float, upper: float) -> Stated:
        """The lesser of the two one-sided capabilities."""
        sides = (self.to_limit(upper, 1), self.to_limit(lower, -1))
        return min(sides, key=lambda side: side.value)


def share(hits: int, count: int) -> Stated:
    """hits/count; its error is binomial, but at least 1/count, which no sample can undercut."""
    p = hits / count
    return Stated(p, max(sqrt(p * (1.0 - p) / count), 1.0 / count))


def _variance_of_std(variance: float, fourth: float) -> float:
    """n times the variance of the standard deviation; 0 where nothing varies."""
    return max(fourth - variance**2, 0.0) / (4.0 * variance) if variance > 0.0 else 0.0
