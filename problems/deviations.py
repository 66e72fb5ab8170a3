"""A promised output as a sum of independent deviations, some of processes known by samples.

The output is normal about its mean, with the variance sum_j s_j^2 + rest, s_j the standard
deviation that variable j adds by the estimates. The samples' uncertainty of s_j and of the mean of
variable j enters by the norm of `models.capability`, or by draws of the posterior.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import ndtr

from ..models.capability import Knowledge, Norm, norm_of
from ..section import Array
from .settings import ASSURED, DRAWS, VALUES_PER_BLOCK, Promise, assured_percent, normal_yield

# Draws of the posterior of processes, and the yields of a sum of deviations over them.
#
# The sum is normal in every draw: its variance is sum_j r_j s_j^2 + rest, its mean is off by
# sum_j e_j m_j, with r_j the drawn variance of process j over its estimate, and e_j the drawn error
# of its mean over the estimated standard deviation.


MIN_VARIANCE = 1e-300
"""Least variance, in place of zero."""


@dataclass(frozen=True, eq=False)
class Draws:
    """Variances over their estimates, and errors of means over the estimates, (draws, k) each."""

    variance: Array
    error: Array

    @classmethod
    def of(cls, known: Sequence[Knowledge | None], seeds: Sequence[Sequence[int]], count: int = DRAWS) -> Draws:
        """Draws of processes, each by a separate seed; None stands for a process that is known."""
        pairs = [
            (np.ones(count), np.zeros(count))
            if knowledge is None
            else knowledge.drawn(count, np.random.default_rng(list(seed)))
            for knowledge, seed in zip(known, seeds, strict=True)
        ]
        if not pairs:
            return cls(np.ones((count, 0)), np.zeros((count, 0)))
        variance, error = zip(*pairs, strict=True)
        return cls(np.stack(variance, axis=1), np.stack(error, axis=1))

    @property
    def count(self) -> int:
        """Number of draws."""
        return len(self.variance)

    @property
    def rows(self) -> int:
        """Designs that are evaluated together."""
        return max(1, VALUES_PER_BLOCK // self.count)


@dataclass(frozen=True, eq=False)
class Sums:
    """A sum of deviations of n designs: its `mean` (n,), by process the standard deviation
    `process_std` and what the mean moves by an error of one standard deviation, `moved` (n, k),
    the variance `known_variance` (n,) of what is known, and the ends that units are to keep.
    """

    mean: Array
    process_std: Array
    moved: Array
    known_variance: Array
    lower: float
    upper: float

    def ends(self, drawn: Draws) -> tuple[Array, Array, Array]:
        """Standard deviation, and how many of these the ends are away from the mean, (n, draws)."""
        square = self.process_std**2 @ drawn.variance.T + self.known_variance[:, None]
        std = np.sqrt(np.maximum(square, MIN_VARIANCE))
        mean = self.mean[:, None] + self.moved @ drawn.error.T
        return std, (self.upper - mean) / std, (self.lower - mean) / std

    def yields(self, drawn: Draws) -> Array:
        """Fractions (n, draws) of the units that keep both ends."""
        _, above, below = self.ends(drawn)
        return np.asarray(ndtr(above) - ndtr(below))


@dataclass(frozen=True, eq=False)
class Deviations:
    """The output of n designs: its `mean` (n,), the standard deviation (n,) that each variable
    adds, the variance `rest` (n,) of known contributions, and the limits of conforming units.
    """

    mean: Array
    each: Mapping[str, Array]
    rest: Array
    lower: float = -np.inf
    upper: float = np.inf

    def stacked(self, names: tuple[str, ...]) -> Array:
        """Standard deviations (n, k) of some variables."""
        return np.stack([self.each[name] for name in names], axis=1)

    def known(self, names: tuple[str, ...]) -> Array:
        """Variance (n,) of all that is not among some variables."""
        others = [std**2 for name, std in self.each.items() if name not in names]
        return np.asarray(np.sum([self.rest, *others], axis=0))

    @property
    def sides(self) -> list[tuple[float, float]]:
        """Direction and place of each limit."""
        ends = ((1.0, self.upper), (-1.0, self.lower))
        return [(side, end) for side, end in ends if np.isfinite(end)]


@dataclass(frozen=True, eq=False)
class PromisedOutput:
    """The promise of an output, given the samples of the processes of some variables."""

    promise: Promise
    processes: Mapping[str, Knowledge]
    seed: int

    @property
    def names(self) -> tuple[str, ...]:
        """The variables whose processes are known by samples."""
        return tuple(self.processes)

    def norm(self, given: Deviations) -> Norm:
        """The norm of the standard deviations (n, k) of these variables."""
        ones = np.ones(len(self.processes))
        quantile = self.quantile(given) if len(given.sides) == 1 else None
        return norm_of(list(self.processes.values()), ones, ones, self.promise.confidence, quantile=quantile)

    def quantile(self, given: Deviations) -> float:
        """Standard deviations that must fit between the mean and each limit."""
        return self.promise.quantile(two_sided=len(given.sides) == 2)

    def spread(self, given: Deviations) -> Array:
        """The standard deviation (n,) that an assured promise uses."""
        rest = np.maximum(given.known(self.names), 1e-300)
        if not self.names:
            return np.sqrt(rest)
        return self.norm(given).value(given.stacked(self.names), rest)

    def promised(self, given: Deviations) -> Array:
        """The promised yield [percent] (n,): assured by the norm, or expected over the draws."""
        if self.promise.statement != ASSURED:
            return 100.0 * np.concatenate([np.empty(0), *(yields.mean(axis=1) for yields in self._yields(given))])
        room = np.min([side * (end - given.mean) for side, end in given.sides], axis=0)
        return normal_yield(room / self.spread(given), two_sided=len(given.sides) == 2)

    def lacking(self, given: Deviations) -> Array:
        """By how much (n,) the nearest limit would have to be widened for an assured promise."""
        reach = self.quantile(given) * self.spread(given)
        return np.asarray(np.max([reach - side * (end - given.mean) for side, end in given.sides], axis=0))

    def assurance(self, given: Deviations) -> tuple[Array, Array]:
        """Probability [percent] (n,) that the promised fraction of units conforms, its error."""
        conforming = [np.mean(yields >= self.promise.fraction, axis=1) for yields in self._yields(given)]
        return assured_percent(np.concatenate([np.empty(0), *conforming]))

    @cached_property
    def _drawn(self) -> Draws:
        """Draws of the processes, which all designs share."""
        return Draws.of(list(self.processes.values()), [(self.seed, at) for at in range(len(self.processes))])

    def _yields(self, given: Deviations) -> list[Array]:
        """Yields (k, draws) of the designs, in parts of limited size."""
        spreads = given.stacked(self.names) if self.names else np.zeros((len(given.mean), 0))
        drawn, known = self._drawn, given.known(self.names)
        parts = [slice(first, first + drawn.rows) for first in range(0, len(spreads), drawn.rows)]
        return [
            Sums(given.mean[rows], spreads[rows], spreads[rows], known[rows], given.lower, given.upper).yields(drawn)
            for rows in parts
        ]
