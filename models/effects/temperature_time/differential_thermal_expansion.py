"""Disc and housing grow differently."""

from __future__ import annotations

from math import inf

import numpy as np

from ....arrays import Array
from ...measurable import Role
from ..effect import Action, EffectParameter, Measurements, Target, Values, quantity, value_or_zero
from ..shapes import POSITIONS, OneColumn, Weight, warming

DISC = "disc_temperature_K"


class DifferentialThermalExpansion(OneColumn):
    """Disc and housing grow differently.

    In a model of the pin circle it acts there: the disc is warmer than the housing by a difference,
    and by a fraction of the measured temperature above 20 degC, where that is known.
    """

    name = "differential_thermal_expansion"
    family = "temperature, time"
    dimensions = POSITIONS
    cause = "The disc is warmer than the housing, and fills the pin circle."
    formula = "a tau d; where a model has a pin circle: disc warmer by D + s tau"
    needs = (Role.TEMPERATURE, Role.DIRECTION)
    mistaken_for = ("thermal_friction", "process_mean_shift", "gauge_bias")
    reference = "ISO 1:2022 (20 degC); thermal expansion of steel"
    weight = Weight("rate", "a, per kelvin above 20 degC", "K", low=-inf)

    def own_applies(self, target: Target) -> bool:
        return target.changes(DISC) or super().own_applies(target)

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        if not target.changes(DISC):
            return super().own_parameters(target)
        constant = quantity("temperature_difference", "K", "D, disc less housing", -100.0, 100.0)
        per_kelvin = quantity("temperature_share", "", "s, per kelvin above 20 degC", -2.0, 2.0)
        if Role.TEMPERATURE not in target.roles():
            return (constant,)
        return (per_kelvin,) if target.largest else (constant, per_kelvin)

    def own_action(self, measurements: Measurements, values: Values, target: Target) -> Action:
        if not target.changes(DISC):
            return super().own_action(measurements, values, target)
        warmer = np.full(len(measurements), value_or_zero(values, "temperature_difference_K"))
        if Role.TEMPERATURE in measurements:
            warmer += value_or_zero(values, "temperature_share") * warming(measurements)
        return Action(changes={DISC: warmer})

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.asarray(warming(measurements) * measurements[Role.DIRECTION])
