"""How the tolerance of a variable stands on a drawing; by default as its settings say."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ...arrays import Array
from ..declaration import Interval
from .base import Interface

if TYPE_CHECKING:
    from ...models.costs import CostCurve


class Drawing(Interface):
    """Ranges, zones, classes and prices of the variables of a problem."""

    def room(self, name: str, design: Array) -> Interval:
        """The range of a variable in which the rest of a full design (all variables,) leaves it."""
        problem = self._problem
        at = [variable.name for variable in problem.free].index(name)
        return float(problem.xl[at]), float(problem.xu[at])

    def zone(self, name: str) -> tuple[float | None, float]:
        """Nominal size of what a variable tolerates, None where it is not known, and the middle of
        its zone as a deviation from it, both in the unit of the variable.
        """
        return None, self._problem.settings.variables[name].mid or 0.0

    def drawn(self, name: str) -> Mapping[str, str]:
        """What the drawing says of the part that a variable tolerates: `class` (g6), `symbol`,
        number of the `drawing` and of the `characteristic`; what is not known is left out.
        """
        return {}

    def curves_of(self, name: str) -> tuple[tuple[CostCurve, float], ...]:
        """The cost curve of a variable and how often it is paid, one for each way of making it.

        Empty where nothing is paid, or where what is paid is no function of the variable alone.
        """
        curve = self._problem.settings.costs.get(name)
        return () if curve is None else ((curve, 1.0),)
