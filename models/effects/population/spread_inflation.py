"""Units scatter more than the allocation says."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...inputs.distribution import Array
from ..effect import EffectParameter, Readings, Target, quantity, value_or_zero
from .law import Law
from .units import OfUnits


class SpreadInflation(OfUnits):
    """Units scatter more than the allocation says."""

    name = "spread_inflation"
    family = "population"
    cause = "The process scatters more than its capability says."
    formula = "y + g (y - mean)"
    mistaken_for = ("lot_mixture", "tool_wear_drift")
    reference = "Montgomery, Introduction to Statistical Quality Control, 2013"

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        return (quantity("growth", "", "g, growth of the standard deviation as a share of it"),)

    def law(self, law: Law, values: Mapping[str, float], target: Target) -> Law:
        return law.widened(value_or_zero(values, "growth"))

    def units(
        self,
        readings: Readings,
        values: Mapping[str, float],
        target: Target,
        drawn: Array,
        mean: float,
        rng: np.random.Generator,
    ) -> Array:
        return drawn + value_or_zero(values, "growth") * (drawn - mean)
