"""The exact stack: yield and half-width by scrambled Sobol sampling of the requirement itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from ...arrays import Array
from ..propagation.monte_carlo import REPLICATES, power_of, replicates
from .made import Tolerances
from .mechanism import Mechanism

MEMORY = 2**22
"""Bytes that the pieces of a block of designs may take."""


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """Deviations z (replicates, k, m) that every design of every batch is built with."""

    deviations: Array

    @classmethod
    def draw(cls, mechanism: Mechanism, samples: int, rng: np.random.Generator) -> Sample:
        """A scrambled Sobol sample, in independent replicates (Owen 1997, Ann. Stat. 25(4)).

        Correlated pieces are normal: z = mean + std L g with L L' the correlation matrix. Dimensions
        belong to the names of the pieces, so that the order of the parts does not matter.
        """
        order = sorted(range(len(mechanism.owner)), key=lambda at: mechanism.names[at])
        kinds = [mechanism.inputs[mechanism.owner[at]] for at in order]
        correlation = mechanism.correlation
        root = None if correlation is None else _root(correlation[np.ix_(order, order)])
        deviations = np.empty((REPLICATES, len(kinds), 2 ** power_of(samples)))
        # One replicate after the other: the points of all of them would double the memory.
        for replicate, uniform in zip(deviations, replicates(samples, len(kinds), rng), strict=True):
            points = uniform
            if root is not None:
                points = ndtr(np.clip(ndtri(uniform), -8.0, 8.0) @ root.T)
            for i, (at, kind) in enumerate(zip(order, kinds, strict=True)):
                replicate[at] = kind.quantile(points[:, i])
        return cls(deviations)

    @property
    def size(self) -> int:
        """Units in all."""
        return int(self.deviations[:, 0].size)

    def blocks(self, mechanism: Mechanism, t: Tolerances) -> Iterator[tuple[slice, Array]]:
        """Rows of a block of designs, and y (block, replicates, m) of all units of each."""
        _, pieces, units = self.deviations.shape
        wide = max(1, MEMORY // (8 * max(self.size, (pieces + 6) * units)))
        for start in range(0, len(t), wide):
            chosen = slice(start, start + wide)
            block = [mechanism.values(t[chosen], z) for z in self.deviations]
            yield chosen, np.stack(block, axis=1)


def _root(correlation: Array) -> Array:
    """L with L L' = correlation, also where it is singular."""
    values, vectors = np.linalg.eigh(correlation)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def yield_percent(mechanism: Mechanism, t: Tolerances, sample: Sample) -> tuple[Array, Array]:
    """Fraction of units within the limits (n,), in percent, and its standard error (n,).

    A unit for which the requirement has no value does not conform. The error follows from the
    scatter over the replicates, and is at least one unit of the sample.
    """
    return joint_yield_percent((mechanism,), t, sample)


def joint_yield_percent(mechanisms: Sequence[Mechanism], t: Tolerances, sample: Sample) -> tuple[Array, Array]:
    """`yield_percent` of the units that conform to all of several mechanisms."""
    yields, error = np.empty(len(t)), np.empty(len(t))
    least = 1.0 / sample.size
    for blocks in zip(*(sample.blocks(mechanism, t) for mechanism in mechanisms), strict=True):
        rows = blocks[0][0]
        with np.errstate(invalid="ignore"):
            within = [
                (y >= mechanism.lower) & (y <= mechanism.upper)
                for mechanism, (_, y) in zip(mechanisms, blocks, strict=True)
            ]
        conforming = np.mean(np.logical_and.reduce(within), axis=2)
        yields[rows] = conforming.mean(axis=1)
        error[rows] = np.maximum(conforming.std(axis=1, ddof=1) / np.sqrt(conforming.shape[1]), least)
    return 100.0 * yields, 100.0 * error


def half_width(mechanism: Mechanism, t: Tolerances, sample: Sample, coverage: float) -> Array:
    """Half the width (n,) of the interval that holds `coverage` of the units, with equal tails.

    (q(1 - a/2) - q(a/2))/2 with a = 1 - coverage: for normal parts of a linear stack and a coverage
    of 0.9973 the root sum square. Units without a value are omitted: see `least_margin`. NaN where
    no unit has a value.
    """
    widths = np.empty(len(t))
    tail = 0.5 * (1.0 - coverage)
    for rows, y in sample.blocks(mechanism, t):
        units = y.reshape(len(y), -1)
        kind = np.quantile if np.all(np.isfinite(units)) else np.nanquantile
        ends = kind(units, [tail, 1.0 - tail], axis=1, method="median_unbiased")
        widths[rows] = 0.5 * (ends[1] - ends[0])
    return widths
