"""The interface of a propagation method."""

from __future__ import annotations

from abc import ABC, abstractmethod

from .result import Propagated, joined
from .sums import ClippedSum


class Propagation(ABC):
    """Propagates the spread of the inputs to that of a `ClippedSum`."""

    @property
    @abstractmethod
    def block(self) -> int:
        """Designs computed at once, so that the working set stays in the cache."""

    @abstractmethod
    def _propagate(self, total: ClippedSum, coverage: float, limit: float) -> Propagated:
        """`propagate` for a block of designs."""

    def propagate(self, total: ClippedSum, coverage: float, limit: float) -> Propagated:
        """Statistics of `total` for its n designs.

        `coverage` is the one-sided probability of the quantile, in (0, 1); `limit` is the value
        that conforming units do not exceed, in the unit of the sum.
        """
        starts = range(0, total.size, self.block)
        return joined([self._propagate(total.rows(slice(at, at + self.block)), coverage, limit) for at in starts])
