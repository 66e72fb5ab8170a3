"""Friction that falls as the grease warms."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from ...measurable import Role
from ..effect import EffectParameter, Measurements, Target, Values, quantity
from ..shapes import OneColumn, Weight, warming


class ThermalFriction(OneColumn):
    """Friction that falls as the grease warms."""

    name = "thermal_friction"
    family = "temperature, time"
    cause = "The viscosity of the grease falls with the temperature."
    formula = "a d (exp(-b tau) - 1)"
    needs = (Role.TEMPERATURE, Role.DIRECTION)
    mistaken_for = ("differential_thermal_expansion", "friction_hysteresis")
    reference = "Reynolds, Phil. Trans. R. Soc. 177, 1886: exponential fall of the viscosity"
    weight = Weight("half_width", "a, half of the loop at 20 degC")

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        meaning = "b, relative fall of the viscosity per kelvin"
        return (quantity("decay", "1/K", meaning, 0.005, 0.15, linear=False),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        fallen = np.expm1(-values["decay_per_K"] * warming(measurements))
        return np.asarray(measurements[Role.DIRECTION] * fallen)
