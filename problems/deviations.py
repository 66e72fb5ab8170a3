"""A promised output as a sum of independent deviations, some of processes known by samples.

The output is normal about its mean, with the variance sum_j s_j^2 + rest, s_j the standard
deviation that variable j adds by the estimates. The samples' uncertainty of s_j and of the mean of
variable j enters by the norm of `models.capability`, or by draws of the posterior.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Array
from ..models.capability import Knowledge, Norm, norm_of
from .draws import Draws, Sums
from .promise import ASSURED, Promise, assured_percent, normal_yield


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
