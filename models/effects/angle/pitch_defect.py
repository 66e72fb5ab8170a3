"""One bad pin."""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, inf, log, pi

import numpy as np

from ...inputs.distribution import Array
from ...measurable import Role
from ..effect import EffectParameter, Readings, Target, quantity
from ..shapes import OneColumn, Weight

SCANS = 39


class PitchDefect(OneColumn):
    """A pulse, 39 times per turn: one pin is bad."""

    name = "pitch_defect"
    family = "geometry by angle"
    cause = "One bad pin is scanned by each of the 39 teeth of a disc."
    formula = "h exp(k (cos(39 theta - p) - 1)), k from the pulse's width at half its height"
    needs = (Role.ANGLE,)
    mistaken_for = ("pin_circle_runout", "two_disc_error", "load_sharing")
    reference = "von Mises pulse: Mardia and Jupp, Directional Statistics, 2000"
    weight = Weight("height", "h, height of the pulse", low=-inf)

    def own_applies(self, target: Target) -> bool:
        turns = target.units.get(Role.ANGLE, "rad") == "rad" and target.model != "manipulator_pose"
        return turns and super().own_applies(target)

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        middle = "p, where in a pitch the pulse stands"
        width = "width of the pulse at half its height, as a share of the pitch"
        return (
            quantity("position", "deg", middle, 0.0, 360.0, linear=False),
            quantity("width", "", width, 0.03, 0.25, linear=False),
        )

    def column(self, readings: Readings, values: Mapping[str, float], target: Target) -> Array:
        sharpness = log(2.0) / (1.0 - cos(pi * values["width"]))
        phase = SCANS * readings[Role.ANGLE] - np.radians(values["position_deg"])
        return np.asarray(np.exp(sharpness * (np.cos(phase) - 1.0)))
