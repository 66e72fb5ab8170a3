"""A zero that moves with the temperature."""

from __future__ import annotations

from math import inf

from ....arrays import Array
from ...measurable import Role
from ..effect import Measurements, Target, Values
from ..shapes import OneColumn, Weight, warming


class ThermalZero(OneColumn):
    """An offset in proportion to the temperature above 20 degC, the same in both directions.

    Reference: JCGM 200:2012, 4.21 and 4.23 (drift and variation due to an influence quantity);
    ISO 230-3:2020, environmental temperature variation error.
    """

    name = "thermal_zero"
    family = "temperature, time"
    cause = "Mount, fixture or sensor expand with the temperature, and shift the zero."
    formula = "a tau"
    needs = (Role.TEMPERATURE,)
    mistaken_for = ("drift", "differential_thermal_expansion", "creep")
    reference = "ISO 230-3:2020"
    weight = Weight("rate", "a, per kelvin above 20 degC", "K", low=-inf)

    def own_applies(self, target: Target) -> bool:
        """Not for a population, whose mean moves by `differential_thermal_expansion`."""
        return not target.population and super().own_applies(target)

    def own_reason(self, target: Target) -> str:
        return "the thermal effect on the units of a batch is differential_thermal_expansion"

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return warming(measurements)
