"""The eccentricity's term b t z + q t^2 z^2, bounded by terms that are linear in t.

S is a sum of even, unimodal deviations. Where y - Y >= 0 for every unit, P(S + Y <= y) is at most
what it is with Y replaced by any Y' below it in convex order: F_S is concave above 0 (Jensen). Y'
is uniform about Y's mean, on the largest half-width a for which the integrals of the upper
quantiles of Y' stay below those of Y: a u (1 - u) <= int_u^1 (Q_Y - mean), all u.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ...arrays import Array
from ...models.inputs import Distribution

LEVELS = 4001
"""Quantiles by which a law is compared with a uniform one."""
SAFE = 2e-3
"""Fraction of a half-width, or of a range, that is given up for values between the points."""
WITHIN = 5
"""Points of a cell that are evaluated."""


def uniform_below(values: Array) -> float:
    """Half-width of the largest uniform law about the mean below a sample in convex order.

    `values` (n,) are quantiles at the levels (i + 1/2)/n.
    """
    ordered = np.sort(values)
    n = len(ordered)
    fraction = np.arange(1, n) / n  # fraction above the first i of n quantiles
    upper = np.cumsum((ordered - ordered.mean())[::-1])[::-1][1:] / n
    return max(0.0, float(np.min(upper / (fraction * (1.0 - fraction)))) * (1.0 - SAFE))


def quantiles_of(law: Distribution) -> Array:
    """Quantiles (n,) of a law at the levels (i + 1/2)/n."""
    return np.asarray(law.quantile((np.arange(LEVELS) + 0.5) / LEVELS))


@dataclass(frozen=True)
class Cell:
    """Bounds of Y = b t z + q t^2 z^2 [arcmin] for half-widths t in [low, high] [um].

    `mean_below` and `mean_above` (slope, constant) bound its mean by lines in t, from below and
    from above; `spread` t is the half-width of a uniform law below it in convex order; `least` is
    the least value of any unit, `range` the width of its values, both for the whole cell.
    """

    law: Distribution
    b: float
    q: float
    low: float
    high: float
    z: Array = field(compare=False, repr=False)
    """Quantiles of the law, as `quantiles_of` gives them: cells of one law share them."""

    def values(self, t: float) -> Array:
        """Y at the levels (i + 1/2)/n of z."""
        return np.asarray(self.b * t * self.z + self.q * (t * self.z) ** 2)

    @cached_property
    def _inside(self) -> dict[float, Array]:
        """Y by half-width, at points of the cell."""
        points = np.linspace(self.low, self.high, WITHIN if self.low < self.high else 1)
        return {t: self.values(t) for t in points.tolist()}

    @cached_property
    def spread(self) -> float:
        """Half-width per um of a uniform law below Y in convex order."""
        return float(min(uniform_below(y) / t for t, y in self._inside.items()))

    @property
    def mean_below(self) -> tuple[float, float]:
        """Slope and constant of a line below the mean."""
        return self._line(1.0)

    @property
    def mean_above(self) -> tuple[float, float]:
        """Slope and constant of a line above the mean."""
        slope, constant = self._line(-1.0)
        return -slope, -constant

    def _line(self, side: float) -> tuple[float, float]:
        """A line below side * mean: t^2 lies below its chord and above its tangents."""
        _, m1, m2 = self.law.raw_moments(2)
        bend, slope = side * self.q * float(m2), self.low + self.high
        constant = -self.low * self.high if bend < 0.0 else -0.25 * slope**2
        return side * self.b * float(m1) + bend * slope, bend * constant

    @property
    def least(self) -> float:
        """Least value of any unit."""
        return self._ends[0]

    @property
    def range(self) -> float:
        """Width of the values of all units."""
        return self._ends[1] - self._ends[0]

    @cached_property
    def _ends(self) -> tuple[float, float]:
        """Bounds of the values of all units of the cell: those of the loosest t reach farthest."""
        ends = np.array(self.law.support) * self.high
        if ends[0] > 0.0 or ends[1] < 0.0:
            ends = np.array([min(ends[0], 0.0), max(ends[1], 0.0)])
        vertex = np.clip(-0.5 * self.b / self.q, *ends) if self.q != 0.0 else ends[0]
        deviations = [float(self.b * u + self.q * u * u) for u in (*ends, vertex, 0.0)]
        return min(deviations), max(deviations)

    def quantile_above(self, fraction: float) -> float:
        """A value above the quantile of Y at `fraction`, for all t of the cell."""
        if fraction >= 1.0:
            return self._ends[1]
        quantile = max(float(np.quantile(y, fraction)) for y in self._inside.values())
        return min(self._ends[1], quantile + SAFE * self.range)
