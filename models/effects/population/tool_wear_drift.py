"""Units drift as the tool wears."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf

import numpy as np

from ...inputs.distribution import Array
from ...measurable import Role
from ..effect import EffectParameter, Readings, Target, known
from ..readings import unit_numbers
from ..shapes import Weight
from .units import OfUnits, number


class ToolWearDrift(OfUnits):
    """Units drift as the tool wears."""

    name = "tool_wear_drift"
    family = "population"
    cause = "The tool wears, and each unit is a little further off than the one before it."
    formula = "y + a u, u the number of the unit from 0"
    needs = (Role.UNIT,)
    mistaken_for = ("drift", "spread_inflation", "lot_offset")
    reference = "Montgomery, Introduction to Statistical Quality Control, 2013"
    weight = Weight("rate_per_unit", "a, change from one unit to the next", low=-inf)

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        return (self.weight.of(target.outputs[0], target),)

    def units(
        self,
        readings: Readings,
        values: Mapping[str, float],
        target: Target,
        drawn: Array,
        mean: float,
        rng: np.random.Generator,
    ) -> Array:
        return drawn + known(values, number(self.weight, target)) * unit_numbers(readings)
