"""The same problem at other accuracies than that of a search."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...arrays import Array
from .base import Interface

if TYPE_CHECKING:
    from ..tolerance_problem import ToleranceProblem


class Accuracy(Interface):
    """A finer problem for reported points, a coarser one for algorithms that evaluate much."""

    def reported(self) -> ToleranceProblem:
        """The same problem at the accuracy that reported points need."""
        return self._problem

    def coarser(self) -> ToleranceProblem:
        """The same problem on a smaller sample, for algorithms that evaluate much."""
        return self._problem

    def smooth(self) -> ToleranceProblem:
        """The same problem whose values in a search are smooth, for searches by gradients."""
        return self._problem

    def needed(self, designs: Array) -> dict[str, Array]:
        """Outputs (n,) of full designs as reported: at least the cost, and those that objectives
        and limits name.
        """
        return self._problem.outputs_of(designs, errors=False)
