"""Disc and housing grow differently."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf

import numpy as np

from ...inputs.distribution import Array
from ...measurable import Role
from ..effect import TIME, Readings, Target
from ..shapes import OneColumn, Weight, warming


class DifferentialThermalExpansion(OneColumn):
    """Disc and housing grow differently."""

    name, family = "differential_thermal_expansion", TIME
    cause = "The disc is warmer than the housing, and fills the pin circle."
    formula = "a tau d"
    needs = (Role.TEMPERATURE, Role.DIRECTION)
    mistaken_for = ("thermal_friction",)
    weight = Weight("rate", "a, per kelvin above 20 degC", "K", low=-inf)

    def column(self, readings: Readings, values: Mapping[str, float], target: Target) -> Array:
        return np.asarray(warming(readings) * readings[Role.DIRECTION])
