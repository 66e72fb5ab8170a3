"""What the documents print of a problem; by default nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...arrays import Array
from .base import Interface

if TYPE_CHECKING:
    from ..tolerance_problem import ToleranceProblem


class Documented(Interface):
    """Allocations that a front is compared with."""

    def references(self) -> dict[str, Array]:
        """Allocations that the documents print, by label: full designs (all variables,)."""
        return {}

    def least_cost(self) -> tuple[str, ToleranceProblem] | None:
        """Label and problem of the documents' single-objective allocation, or None."""
        return None
