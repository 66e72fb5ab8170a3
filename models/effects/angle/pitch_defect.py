"""A defective pin."""

from __future__ import annotations

from math import cos, inf, log, pi, tau

import numpy as np

from ....arrays import Array
from ...gear import PINS
from ...measurable import Role
from ..effect import EffectParameter, Measurements, Target, Values, quantity
from ..shapes import OneColumn, Weight, no_waves, turns

BELL, ENDING = 1.0, 2.0
"""Forms of the pulse: it dies away, or begins and ends with the contact."""


class PitchDefect(OneColumn):
    """A pulse at every passing of the pins, 39 times per turn: a pin is defective.

    How a defect is rolled over is not known: the pulse dies away on both sides (von Mises, the
    default), or begins and ends with the contact (a raised cosine, as of a cam). At a
    hundred noise levels the residual of the wrong form has harmonics that would be identified as
    other effects.
    """

    name = "pitch_defect"
    family = "geometry by angle"
    cause = "A defective pin is passed by each tooth of a disc (39 in the RV-40E)."
    formula = (
        "h exp(k (cos(n theta - p) - 1)), n the order in which pins pass (39), k from the pulse's "
        "width at half its height; or, of the same width, a raised cosine that ends"
    )
    needs = (Role.ANGLE,)
    mistaken_for = ("pin_circle_runout", "two_disc_error", "load_sharing")
    reference = "von Mises pulse and raised cosine: Mardia and Jupp, Directional Statistics, 2000, section 3.5"
    weight = Weight("height", "h, height of the pulse", low=-inf)

    def own_applies(self, target: Target) -> bool:
        has_pins = target.gear is not None and target.gear.has(PINS)
        return has_pins and turns(target) and super().own_applies(target)

    def own_reason(self, target: Target) -> str:
        return no_waves(target, PINS)

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        middle = "p, position of the pulse in a pitch"
        width = "width of the pulse at half its height, as a fraction of the pitch"
        form = "1: dies away, 2: ends at twice that width"
        return (
            quantity("position", "deg", middle, 0.0, 360.0, linear=False),
            quantity("width", "", width, 0.03, 0.25, linear=False),
            quantity("form", "", form, BELL, ENDING, linear=False, choices=(BELL, ENDING)),
        )

    def missing(self, values: Values, target: Target) -> tuple[str, ...]:
        return tuple(name for name in super().missing(values, target) if name != "form")

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        scans = target.gear.orders[PINS] if target.gear else 0.0
        phase = scans * measurements[Role.ANGLE] - np.radians(values["position_deg"])
        if values.get("form", BELL) == ENDING:
            away = np.abs((phase + pi) % tau - pi) / (tau * values["width"])
            return np.asarray(np.cos(0.5 * pi * np.minimum(away, 1.0)) ** 2)
        sharpness = log(2.0) / (1.0 - cos(pi * values["width"]))
        return np.asarray(np.exp(sharpness * (np.cos(phase) - 1.0)))
