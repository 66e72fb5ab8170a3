"""Propagation by quasi-Monte Carlo: scrambled Sobol points, a standard error on everything."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy

from ...section import Array
from .sums import ClippedSum, Estimate, Propagated, Propagation, Term, total_cumulants

BLOCK = 8
"""Designs whose units are computed at once: with 4096 units each they stay in the cache."""
QUANTILE_BIAS = 2.0
"""Quantiles of the replicates are biased by up to about their standard error (measured at 0.9973
with 4096 units each), so that error is stated twice."""
REPLICATES = 16
"""Independent scrambles; their scatter is the standard error (Owen 1997, Ann. Stat. 25(4))."""


@dataclass(frozen=True, slots=True, eq=False)
class MonteCarlo(Propagation):
    """Every unit of the base sample goes through all errors of every design.

    The sample is drawn once, `points` of shape (replicates, samples per replicate, dimensions) in
    (0, 1), and reused for all designs of all batches: differences between designs carry common
    random numbers. Standard errors come from the scatter over the replicates; that of a probability
    is at least 1/samples, the least error that a sample without a single hit supports.
    """

    points: Array

    @classmethod
    def draw(cls, samples: int, dimensions: int, rng: np.random.Generator) -> MonteCarlo:
        """A scrambled Sobol sample, rounded up to REPLICATES powers of two."""
        points = np.empty((REPLICATES, 2 ** power_of(samples), dimensions))
        for replicate, values in zip(points, replicates(samples, dimensions, rng), strict=True):
            replicate[:] = values
        return cls(points)

    @property
    def block(self) -> int:
        return 1 << 30

    def _propagate(self, total: ClippedSum, coverage: float, limit: float) -> Propagated:
        cumulants = total_cumulants(total.clipped + total.free)
        replicates = np.array([_replicate(total, sample, coverage, limit) for sample in self.points])
        value = replicates.mean(axis=0)
        error = replicates.std(axis=0, ddof=1) / np.sqrt(len(replicates))
        error[2] *= QUANTILE_BIAS
        error[3:] = np.maximum(error[3:], 1.0 / self.points[..., 0].size)
        estimates = [Estimate(v, e) for v, e in zip(value, error, strict=True)]
        return Propagated(cumulants[0], np.sqrt(cumulants[1]), *estimates)


def power_of(samples: int) -> int:
    """Size of a replicate, as a power of two."""
    return max(1, int(np.ceil(np.log2(max(samples, 2 * REPLICATES) / REPLICATES))))


def replicates(samples: int, dimensions: int, rng: np.random.Generator) -> Iterator[Array]:
    """The points (samples per replicate, dimensions) of each replicate, one after the other."""
    for seed in rng.spawn(REPLICATES):
        sobol = scipy.stats.qmc.Sobol(dimensions, scramble=True, rng=seed)
        yield np.asarray(sobol.random_base2(power_of(samples)))


def _replicate(total: ClippedSum, points: Array, coverage: float, limit: float) -> Array:
    """Mean, std, quantile, conforming and negative probability of a sample, shape (5, n)."""
    clipped, free = _parts(total, points)
    blocks = [slice(at, at + BLOCK) for at in range(0, total.size, BLOCK)]
    return np.concatenate([_unit_statistics(clipped.units(b), free.units(b), coverage, limit) for b in blocks], axis=1)


def units_of(total: ClippedSum, points: Array) -> Array:
    """Units (n, samples) of the n sums at `points` (samples, inputs) in (0, 1)."""
    clipped, free = (part.units(slice(None)) for part in _parts(total, points))
    return np.maximum(clipped, 0.0) + free


def _parts(total: ClippedSum, points: Array) -> tuple[_Part, _Part]:
    """The clipped and the free part at `points` (samples, inputs)."""
    split = len(total.clipped)
    return _Part.of(total.clipped, points[:, :split]), _Part.of(total.free, points[:, split:])


def _unit_statistics(clipped: Array, free: Array, coverage: float, limit: float) -> Array:
    """The statistics (5, n) of n designs from their units, each part (n, samples)."""
    negative = np.count_nonzero(clipped < 0.0, axis=1) / clipped.shape[1]
    effective = np.maximum(clipped, 0.0, out=clipped)
    effective += free
    conforming = np.count_nonzero(effective <= limit, axis=1) / clipped.shape[1]
    mean, std = effective.mean(axis=1), effective.std(axis=1)
    quantile = np.quantile(effective, coverage, axis=1, method="weibull", overwrite_input=True)
    return np.array([mean, std, quantile, conforming, negative])


@dataclass(frozen=True, slots=True)
class _Part:
    """A sum of contributions constant + linear z + quadratic z^2: linear in the features z and z^2.

    `features` (f, samples) are the same for all designs, `weights` (n, f) and `constant` (n,) for
    all samples, so that all units of a block of designs are one matrix product.
    """

    features: Array
    weights: Array
    constant: Array

    @classmethod
    def of(cls, terms: tuple[Term, ...], points: Array) -> _Part:
        z = [term.distribution.quantile(points[:, i]) for i, term in enumerate(terms)]
        bent = [(i, term.quadratic) for i, term in enumerate(terms) if term.quadratic is not None]
        weights = [term.linear for term in terms] + [weight for _, weight in bent]
        return cls(
            np.array(z + [z[i] ** 2 for i, _ in bent]),
            np.array(weights).T.copy(),
            np.sum([term.constant for term in terms], axis=0),
        )

    def units(self, rows: slice) -> Array:
        """Values (n, samples) of the designs `rows`."""
        return self.weights[rows] @ self.features + self.constant[rows, None]
