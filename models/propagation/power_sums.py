"""Mean, spread and capability of a sample, each with its standard error, from sums of powers.

All errors are closed forms to first order in 1/sqrt(n) (delta method) and hold for any
distribution with four moments; for a normal one they are the textbook sigma/sqrt(n),
sigma/sqrt(2 n), and those of Bissell (1990), J. Royal Stat. Soc. C 39(3), 331-340, for Cp and Cpk.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt

from ...arrays import Array


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
        return Stated(sqrt(variance), sqrt(_of_std(variance, fourth) / self.count))

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
        square = by_mean**2 * variance + by_std**2 * _of_std(variance, fourth)
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


def _of_std(variance: float, fourth: float) -> float:
    """n times the variance of the standard deviation; 0 where nothing varies."""
    return max(fourth - variance**2, 0.0) / (4.0 * variance) if variance > 0.0 else 0.0
