"""Statistics over units of a sample in which the involute stage is integrated exactly.

The backlash of a unit is phi_1 + Y, independent, with Y known for every unit of the sample and the
distribution of phi_1 known: P(phi_1 + Y <= v) = mean_i H((v - Y_i - m)/s). That is smooth in every
tolerance and scatters by a quarter of the scatter of an order statistic.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import betainc, ndtr

from ....arrays import Array
from ...inputs import Distribution, Uniform

SMOOTHING = 0.01
"""Scale [arcmin] at which a stage without backlash is smoothed, far below that of any unit."""
STILL = 1e-9
"""Growth [arcmin] with a standardised error below which a value does not move with it."""
NODES = 8193
"""Nodes of the table of a law, evenly over its support and as many evenly by probability: errors
below 1e-7."""


@lru_cache(maxsize=16)
def _table(law: Distribution) -> tuple[Array, Array, Array]:
    """Nodes over the support of a law, its averaged distribution and density, 0 at the ends."""
    low, high = law.support
    evenly = np.linspace(low - law.grain, high + law.grain, NODES)
    nodes = np.unique(np.concatenate([evenly, law.quantile(np.linspace(1e-9, 1.0 - 1e-9, NODES))]))
    below, density = law.averaged(nodes)
    below[[0, -1]], density[[0, -1]] = (0.0, 1.0), 0.0
    return nodes, below, density


def law_below(law: Distribution, z: Array) -> Array:
    """P(Z <= z) of a law averaged over its grain, shape of `z`, between the nodes of a table."""
    nodes, below, _ = _table(law)
    return np.asarray(np.interp(z, nodes, below))


def law_density(law: Distribution, z: Array) -> Array:
    """Derivative of `law_below`, shape of `z`."""
    nodes, _, density = _table(law)
    return np.asarray(np.interp(z, nodes, density))


@dataclass(frozen=True, slots=True)
class Involute:
    """phi_1 = middle + half z over units [arcmin], z the standardised clearance of a unit, with the
    law `planet` of that of its tighter planet.

    `half` is 0 for a reducer without involute stage: a quantile is smoothed by `SMOOTHING`.
    """

    middle: float
    half: float
    planet: Distribution

    @property
    def mean(self) -> float:
        """Mean of phi_1 [arcmin]."""
        return self.middle + self.half * float(self.planet.raw_moments(1)[1])

    @property
    def variance(self) -> float:
        """Variance of phi_1 [arcmin^2]."""
        _, first, second = self.planet.raw_moments(2)
        return float(self.half**2 * (second - first**2))

    def cdf(self, excess: Array) -> Array:
        """P(phi_1 <= excess) of [arcmin], smoothed where the stage has no backlash."""
        if self.half == 0.0:
            return np.asarray(ndtr((excess - self.middle) / SMOOTHING))
        return law_below(self.planet, (excess - self.middle) / self.half)

    def density(self, excess: Array) -> Array:
        """Derivative of `cdf` [1/arcmin]."""
        if self.half == 0.0:
            z = (excess - self.middle) / SMOOTHING
            return np.asarray(np.exp(-0.5 * z * z) / (np.sqrt(2.0 * np.pi) * SMOOTHING))
        return law_density(self.planet, (excess - self.middle) / self.half) / self.half

    def ends(self) -> tuple[float, float]:
        """Least and largest phi_1 [arcmin]."""
        if self.half == 0.0:
            return self.middle - 8.0 * SMOOTHING, self.middle + 8.0 * SMOOTHING
        nodes = _table(self.planet)[0]
        return self.middle + self.half * float(nodes[0]), self.middle + self.half * float(nodes[-1])


NO_STAGE = Involute(0.0, 0.0, Uniform())
"""No involute stage at all."""


@dataclass(frozen=True, slots=True, eq=False)
class Statistic:
    """A statistic over units with its derivatives.

    `weight` (n,) is its derivative by the value of each unit, `by_involute` [1/(fraction of phi_1)]
    that by the size of phi_1, ln(middle) = ln(half), `by_zone` that by the size ln(t) of the zone
    whose error a unit is integrated over; `error` is the standard error of a sample of independent
    units, which a Sobol sample stays below.
    """

    value: float
    weight: Array
    by_involute: float
    error: float
    by_zone: float = 0.0


def quantile(values: Array, involute: Involute, coverage: float) -> Statistic:
    """One-sided quantile at `coverage` of phi_1 + Y, `values` (n,) of Y [arcmin]."""
    low, high = involute.ends()
    low, high = low + float(values.min()), high + float(values.max())
    at = float(np.quantile(values, coverage)) + involute.mean
    for _ in range(200):
        fraction = float(np.mean(involute.cdf(at - values)))
        low, high = (at, high) if fraction < coverage else (low, at)
        slope = float(np.mean(involute.density(at - values)))
        ahead = at - (fraction - coverage) / slope if slope > 0.0 else low
        ahead = ahead if low < ahead < high else 0.5 * (low + high)
        if abs(ahead - at) <= 1e-12 * max(1.0, abs(at)):
            break
        at = ahead
    density = involute.density(at - values)
    total = max(float(density.sum()), 1e-300)
    weight = density / total
    spread = float(np.std(involute.cdf(at - values)))
    return Statistic(
        at, weight, float(np.sum(weight * (at - values))), spread / (total / len(values)) / np.sqrt(len(values))
    )


def mean(values: Array, involute: Involute) -> Statistic:
    """Mean of phi_1 + Y."""
    count = len(values)
    error = np.sqrt((float(np.var(values)) + involute.variance) / count)
    return Statistic(float(np.mean(values)) + involute.mean, np.full(count, 1.0 / count), involute.mean, error)


def deviation(values: Array, involute: Involute) -> Statistic:
    """Standard deviation of phi_1 + Y."""
    count, centred = len(values), values - np.mean(values)
    value = float(np.sqrt(np.mean(centred**2) + involute.variance))
    safe = max(value, 1e-300)
    fourth = float(np.mean(centred**4))
    error = np.sqrt(max(fourth - np.mean(centred**2) ** 2, 0.0) / count) / (2.0 * safe)
    return Statistic(value, centred / (count * safe), involute.variance / safe, float(error))


def share_within(values: Array, involute: Involute, limit: float) -> Statistic:
    """P(phi_1 + Y <= limit)."""
    within, density = involute.cdf(limit - values), involute.density(limit - values)
    count = len(values)
    return Statistic(
        float(np.mean(within)),
        -density / count,
        -float(np.mean(density * (limit - values))),
        float(np.std(within)) / np.sqrt(count),
    )


def ordered_quantile(values: Array, coverage: float) -> Statistic:
    """Quantile of `values` (n,) themselves (Harrell & Davis 1982): smooth in each of them."""
    count = len(values)
    a, b = coverage * (count + 1.0), (1.0 - coverage) * (count + 1.0)
    edges = betainc(a, b, np.linspace(0.0, 1.0, count + 1))
    weight = np.empty(count)
    order = np.argsort(values, kind="stable")
    weight[order] = np.diff(edges)
    value = float(weight @ values)
    error = float(np.sqrt(weight @ (values - value) ** 2))
    return Statistic(value, weight, 0.0, error)


def share_below(values: Array, limit: float, growth: Array, z: Array, law: Distribution) -> Statistic:
    """P(Y < limit), each unit integrated over its standardised error z, which has the `law`.

    Y of unit i grows by `growth` (n,) per unit of `z` (n,): with u_i the z at which it would meet
    the limit, its probability is P(z < u_i), P(z > u_i) where it falls, and 0 or 1 where it stays.
    """
    steep = np.abs(growth)
    moves = steep > STILL
    meets = z + (limit - values) / np.where(moves, growth, 1.0)
    probability = law_below(law, meets)
    below = np.where(moves, np.where(growth > 0.0, probability, 1.0 - probability), values < limit)
    count = len(values)
    weight = np.where(moves, -law_density(law, meets) / np.where(moves, steep, 1.0), 0.0) / count
    error = float(np.std(below)) / np.sqrt(count)
    by_zone = float(np.sum(weight * (limit - values)))
    return Statistic(float(np.mean(below)), weight, 0.0, error, by_zone)


def share_above(values: Array, limit: float) -> Statistic:
    """P(Y > limit) with a normal kernel of Silverman's width, so that it has derivatives."""
    count, spread = len(values), max(float(np.std(values)), 1e-12)
    width = 0.9 * spread * count**-0.2
    z = (values - limit) / width
    above, density = ndtr(z), np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi)
    by_width = -float(np.mean(density * z)) / spread  # the width grows with the spread
    by_spread = (values - np.mean(values)) / (count * spread)
    weight = density / (width * count) + by_width * by_spread
    error = float(np.std(above)) / np.sqrt(count)
    return Statistic(float(np.mean(above)), weight, 0.0, error)
