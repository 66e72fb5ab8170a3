"""All units are off by the same."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf

import numpy as np

from ...inputs.distribution import Array
from ..effect import EffectParameter, Readings, Target, known
from ..shapes import Weight
from .units import OfUnits, number


class ProcessMeanShift(OfUnits):
    """All units are off by the same."""

    name = "process_mean_shift"
    family = "population"
    cause = "The process runs off its middle: every unit is off by the same."
    formula = "y + c"
    mistaken_for = ("gauge_bias", "lot_mixture", "differential_thermal_expansion")
    reference = "Montgomery, Introduction to Statistical Quality Control, 2013"
    weight = Weight("shift", "c, shift of the mean", low=-inf)

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
        return drawn + known(values, number(self.weight, target))
