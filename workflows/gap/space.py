"""Whitened space: the outputs one below the other, each divided by its own noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .noise import Noise


@dataclass(frozen=True)
class Space:
    """Rows (N,) of q outputs with n measurements each, and one row for each tolerance (prior,).

    A free parameter that moves by its tolerance costs as much as a measurement that is off by one
    standard deviation: the tolerance is the standard deviation of its prior.
    """

    noises: tuple[Noise, ...]
    prior: int = 0

    @property
    def rows_per_output(self) -> int:
        """Rows of one output."""
        return len(self.noises[0].sigma)

    @property
    def count(self) -> int:
        """The number of measurements that count."""
        return self.rows_per_output * len(self.noises) - sum(noise.outliers for noise in self.noises)

    @property
    def is_plain(self) -> bool:
        """Whether every measurement of an output counts the same."""
        return all(noise.is_plain for noise in self.noises)

    def unweighted(self) -> Space:
        """A space in which every measurement of an output counts the same."""
        return Space(tuple(noise.independent() for noise in self.noises), self.prior)

    def whiten(self, columns: Array) -> Array:
        """Columns (N,) or (N, m) whitened, with zeros in the rows of the prior."""
        if len(self.noises) == 1 and not self.prior:
            return self.noises[0].whiten(columns)
        parts = np.split(columns, len(self.noises))
        white = [noise.whiten(part) for noise, part in zip(self.noises, parts, strict=True)]
        tail = np.zeros((self.prior, *columns.shape[1:]))
        return np.concatenate([*white, tail])

    def with_prior(self, free: Array) -> Array:
        """Columns (N, prior + zeros) of the free parameters, each for its whole tolerance; the last
        ones are zeros of outputs, which have no tolerance.
        """
        white = self.whiten(free)
        white[len(white) - self.prior :, : self.prior] = np.eye(self.prior)
        return white

    def level(self) -> Array:
        """Noise level (q,) of each output, in its unit."""
        return np.array([noise.level for noise in self.noises])
