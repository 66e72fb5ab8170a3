"""One bad pin."""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, inf, log, pi

import numpy as np

from ...gear import PINS
from ...inputs.distribution import Array
from ...measurable import Role
from ..effect import EffectParameter, Readings, Target, quantity
from ..shapes import OneColumn, Weight, no_waves, turns


class PitchDefect(OneColumn):
    """A pulse at every passing of the pins, 39 times per turn: one pin is bad."""

    name = "pitch_defect"
    family = "geometry by angle"
    cause = "One bad pin is scanned by each tooth of a disc (39 in the RV-40E)."
    formula = (
        "h exp(k (cos(n theta - p) - 1)), n the order in which pins pass (39), k from the pulse's "
        "width at half its height"
    )
    needs = (Role.ANGLE,)
    mistaken_for = ("pin_circle_runout", "two_disc_error", "load_sharing")
    reference = "von Mises pulse: Mardia and Jupp, Directional Statistics, 2000"
    weight = Weight("height", "h, height of the pulse", low=-inf)

    def own_applies(self, target: Target) -> bool:
        known = target.gear is not None and target.gear.has(PINS)
        return known and turns(target) and super().own_applies(target)

    def own_reason(self, target: Target) -> str:
        return no_waves(target, PINS)

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        middle = "p, where in a pitch the pulse stands"
        width = "width of the pulse at half its height, as a share of the pitch"
        return (
            quantity("position", "deg", middle, 0.0, 360.0, linear=False),
            quantity("width", "", width, 0.03, 0.25, linear=False),
        )

    def column(self, readings: Readings, values: Mapping[str, float], target: Target) -> Array:
        sharpness = log(2.0) / (1.0 - cos(pi * values["width"]))
        scans = target.gear.orders[PINS] if target.gear else 0.0
        phase = scans * readings[Role.ANGLE] - np.radians(values["position_deg"])
        return np.asarray(np.exp(sharpness * (np.cos(phase) - 1.0)))
