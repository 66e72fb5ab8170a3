"""Effects that grow with the temperature or with time."""

from __future__ import annotations

from math import inf

import numpy as np

from ...section import Array
from ..measurable import Role
from .effect import Action, EffectParameter, Measurements, Target, Values, quantity, value_or_zero
from .shapes import POSITIONS, OneColumn, Weight, warming


class Creep(OneColumn):
    """A measurement that settles logarithmically."""

    name = "creep"
    family = "temperature, time"
    cause = "Grease and joints settle under load, ever more slowly."
    formula = "a ln(1 + t/t0)"
    needs = (Role.TIME,)
    mistaken_for = ("drift", "wear")
    reference = "Nabarro, Mater. Sci. Eng. A 309, 2001"
    weight = Weight("rate", "a, per factor e of time")

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        last = target.largest.get(Role.TIME, 0.0)
        low, high = (1e-4 * last, 0.5 * last) if last > 0.0 else (0.0, inf)
        return (quantity("begin", "s", "t0, when it begins to slow down", low, high, linear=False),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        since = np.maximum(measurements[Role.TIME], 0.0)  # before its beginning nothing creeps
        return np.asarray(np.log1p(since / max(values["begin_s"], np.finfo(float).tiny)))


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


class Drift(OneColumn):
    """A measurement that changes with time."""

    name = "drift"
    family = "temperature, time"
    cause = "The measured quantity changes steadily during the measurement."
    formula = "a t"
    needs = (Role.TIME,)
    mistaken_for = ("creep", "wear")
    reference = "JCGM 200:2012, 4.21 instrumental drift"
    along_units = True
    weight = Weight("rate", "a, per second", "s")

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.asarray(measurements[Role.TIME], dtype=float)


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
    of_rows = True
    mistaken_for = ("drift", "differential_thermal_expansion", "creep")
    reference = "ISO 230-3:2020"
    weight = Weight("rate", "a, per kelvin above 20 degC", "K", low=-inf)

    def own_reason(self, target: Target) -> str:
        return "the thermal effect on the units of a batch is differential_thermal_expansion"

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return warming(measurements)


class Wear(OneColumn):
    """Backlash that grows with time."""

    name = "wear"
    family = "temperature, time"
    dimensions = POSITIONS
    cause = "Flanks wear, and the gap between the two directions grows."
    formula = "a t d"
    needs = (Role.TIME, Role.DIRECTION)
    mistaken_for = ("drift", "friction_hysteresis", "clock_drift")
    reference = "Archard, J. Appl. Phys. 24, 1953"
    weight = Weight("rate", "a, half of the gap per second", "s")

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.asarray(measurements[Role.TIME] * measurements[Role.DIRECTION])
