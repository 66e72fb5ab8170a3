"""Units scatter more than the allocation assumes."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from ..effect import EffectParameter, Measurements, Target, Values, quantity, value_or_zero
from .law import Law
from .units import OfUnits


class SpreadInflation(OfUnits):
    """Units scatter more than the allocation assumes."""

    name = "spread_inflation"
    family = "population"
    cause = "The process scatters more than its capability implies."
    formula = "y + g (y - mean)"
    mistaken_for = ("lot_mixture", "tool_wear_drift")
    reference = "Montgomery, Introduction to Statistical Quality Control, 2013"

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        return (quantity("growth", "", "g, relative growth of the standard deviation"),)

    def law(self, law: Law, values: Values, target: Target) -> Law:
        return law.widened(value_or_zero(values, "growth"))

    def units(
        self,
        measurements: Measurements,
        values: Values,
        target: Target,
        drawn: Array,
        mean: float,
        rng: np.random.Generator,
    ) -> Array:
        return drawn + value_or_zero(values, "growth") * (drawn - mean)
