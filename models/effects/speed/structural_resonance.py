"""A wave that a natural frequency magnifies."""

from __future__ import annotations

from math import inf

import numpy as np
from numpy.typing import NDArray

from ...measurable import Role
from ..effect import EffectParameter, Measurements, Target, Values, quantity
from ..shapes import Columns, Shape, Weight, no_waves

Waves = NDArray[np.complex128]


class StructuralResonance(Shape):
    """Fixed frequency: a wave of any order, magnified where it meets a resonance."""

    name = "structural_resonance"
    family = "speed"
    cause = "A wave of some order excites a natural frequency of the structure at some speed."
    formula = "Re[(c - j s) H exp(j k theta)], H = 1/(1 - r^2 + 2 j z r), r = k v d/f"
    needs = (Role.ANGLE, Role.SPEED)
    mistaken_for = ("eccentric_error", "pin_circle_runout", "two_disc_error", "sun_runout")
    reference = "Den Hartog, Mechanical Vibrations, 1985, section 2.9"

    def own_applies(self, target: Target) -> bool:
        turning = all(target.units.get(role) == unit for role, unit in ((Role.ANGLE, "rad"), (Role.SPEED, "rpm")))
        return turning and target.gear is not None and super().own_applies(target)

    def own_reason(self, target: Target) -> str:
        return no_waves(target)

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (
            Weight("cos", "c, cosine component of the excitation", low=-inf),
            Weight("sin", "s, its sine component", low=-inf),
        )

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        order = "k, order of the excitation in waves per turn of the angle: those of the gear"
        orders = target.gear.waves if target.gear is not None else ()
        first, last = (orders[0], orders[-1]) if orders else (0.0, inf)
        fastest = target.largest.get(Role.SPEED, 0.0) / 60.0
        # between a quarter of the slowest wave at full speed and just above the quickest
        bounds = (0.25 * first * fastest, 1.1 * last * fastest)
        low, high = bounds if fastest > 0.0 else (0.0, inf)
        return (
            quantity("frequency", "Hz", "f, the natural frequency", low, high, linear=False),
            quantity("damping", "", "z, fraction of the critical damping", 0.005, 0.3, linear=False),
            quantity("order", "", order, first, last, linear=False, choices=orders),
        )

    def columns(self, measurements: Measurements, values: Values, target: Target) -> Columns:
        wave = response(measurements, values["order"], values["frequency_Hz"], values["damping"])
        return {"cos": lambda: np.ascontiguousarray(wave.real), "sin": lambda: wave.imag.copy()}


def response(measurements: Measurements, order: float, frequency: float, damping: float) -> Waves:
    """H exp(j k theta) (n,), complex; against the direction the wave runs backwards in time."""
    turning = measurements[Role.SPEED] / 60.0
    if Role.DIRECTION in measurements:
        turning = turning * measurements[Role.DIRECTION]
    ratio = order * turning / max(frequency, np.finfo(float).tiny)
    answer = 1.0 / (1.0 - ratio**2 + 2j * damping * ratio)
    return np.asarray(answer * np.exp(1j * order * measurements[Role.ANGLE]))
