"""Links and base grow with temperature."""

from __future__ import annotations

from ....arrays import Array
from ...measurable import Role
from ..effect import EffectParameter, Measurements, Target, Values, quantity
from ..inside import InsideSeveral
from ..shapes import warming


class ThermalGrowth(InsideSeveral):
    """Links and base grow with temperature."""

    name = "thermal_growth"
    family = "manipulator"
    cause = "Links and base warm up equally, and all lengths grow by the same factor."
    formula = "all lengths times 1 + a tau"
    needs = (Role.TEMPERATURE, Role.POSITION)
    mistaken_for = ("arm_length_error",)
    reference = "ISO 230-3:2020"

    def numbers(self, target: Target) -> tuple[tuple[EffectParameter, str], ...]:
        meaning = "a, expansion per kelvin above 20 degC"
        return ((quantity("expansion_per_K", "ppm", meaning), "growth_ppm"),)

    def factor(self, measurements: Measurements, values: Values) -> Array:
        return warming(measurements)
