"""Units drift as the tool wears."""

from __future__ import annotations

from math import inf
from typing import Any

from numpy.typing import NDArray

from ...measurable import Role
from ..effect import Measurements
from ..measurements import unit_numbers
from ..shapes import Weight
from .units import MovedUnits


class ToolWearDrift(MovedUnits):
    """Units drift as the tool wears."""

    name = "tool_wear_drift"
    family = "population"
    cause = "The tool wears, and each unit deviates a little more than the unit before it."
    formula = "y + a u, u the number of the unit from 0"
    needs = (Role.UNIT,)
    mistaken_for = ("drift", "spread_inflation", "lot_offset")
    reference = "Montgomery, Introduction to Statistical Quality Control, 2013"
    along_units = True
    weight = Weight("rate_per_unit", "a, change from one unit to the next", low=-inf)

    def pattern(self, measurements: Measurements) -> NDArray[Any]:
        return unit_numbers(measurements)
