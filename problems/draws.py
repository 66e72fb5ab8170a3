"""Draws of the posterior of processes, and the yields of a sum of deviations over them.

The sum is normal in every draw: its variance is sum_j r_j s_j^2 + rest, its mean is off by
sum_j e_j m_j, with r_j the drawn variance of process j over its estimate, and e_j the drawn error
of its mean over the estimated standard deviation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from ..arrays import Array
from ..models.capability import Knowledge
from .promise import AT_ONCE, DRAWS

LEAST = 1e-300
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
        return max(1, AT_ONCE // self.count)


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
        std = np.sqrt(np.maximum(square, LEAST))
        mean = self.mean[:, None] + self.moved @ drawn.error.T
        return std, (self.upper - mean) / std, (self.lower - mean) / std

    def yields(self, drawn: Draws) -> Array:
        """Fractions (n, draws) of the units that keep both ends."""
        _, above, below = self.ends(drawn)
        return np.asarray(ndtr(above) - ndtr(below))
