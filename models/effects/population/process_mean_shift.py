"""All units deviate by the same amount."""

from __future__ import annotations

from math import inf

from ..effect import Measurements
from ..shapes import Weight
from .units import MovedUnits


class ProcessMeanShift(MovedUnits):
    """All units deviate by the same amount."""

    name = "process_mean_shift"
    family = "population"
    cause = "The process mean is off its target: every unit deviates by the same amount."
    formula = "y + c"
    mistaken_for = ("gauge_bias", "lot_mixture", "differential_thermal_expansion")
    reference = "Montgomery, Introduction to Statistical Quality Control, 2013"
    weight = Weight("shift", "c, shift of the mean", low=-inf)

    def pattern(self, measurements: Measurements) -> float:
        return 1.0
