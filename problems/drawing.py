"""How the tolerance of a variable stands on a drawing; by default as its settings say."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..declarations import Variable
from .settings import Settings

Array = NDArray[np.float64]
Interval = tuple[float, float]
"""Lower and upper end: of a search range, or proven of an output; infinite where not known."""


class Drawing:
    """Ranges, zones and classes of the variables of a problem."""

    settings: Settings
    free: tuple[Variable, ...]
    xl: Array
    xu: Array

    def room(self, name: str, design: Array) -> Interval:
        """The range of a variable in which the rest of a full design (all variables,) leaves it."""
        at = [variable.name for variable in self.free].index(name)
        return float(self.xl[at]), float(self.xu[at])

    def zone(self, name: str) -> tuple[float | None, float]:
        """Nominal size of what a variable tolerates, None where it is not known, and the middle of
        its zone as a deviation from it, both in the unit of the variable.
        """
        return None, self.settings.variables[name].mid or 0.0

    def drawn(self, name: str) -> Mapping[str, str]:
        """What the drawing says of the part that a variable tolerates: `class` (g6), `symbol`,
        number of the `drawing` and of the `characteristic`; what is not known is left out.
        """
        return {}
