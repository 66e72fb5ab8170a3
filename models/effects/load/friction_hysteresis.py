"""A loop between motion, or loading, there and back."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...inputs.distribution import Array
from ...measurable import Role
from ..effect import EffectParameter, Readings, Target, quantity
from ..path import along_path
from ..shapes import Load, OneColumn, Weight

LOCKED = "rv_lost_motion"


class FrictionHysteresis(OneColumn):
    """Loop of dry friction, between there and back."""

    name = "friction_hysteresis"
    family = "load"
    cause = "Dry friction holds part of the twist back until the motion, or the load, turns round."
    formula = "a d; input locked: c (play(T, w) - T) along the path"
    needs = (Role.DIRECTION,)
    mistaken_for = ("lost_motion", "viscous_friction", "wear")
    reference = "Visintin, Differential Models of Hysteresis, 1994"

    def own_applies(self, target: Target) -> bool:
        if target.model == LOCKED:
            return Load.role(target) is not None
        return super().own_applies(target)

    def weights(self, target: Target) -> tuple[Weight, ...]:
        if target.model == LOCKED:
            meaning = "c, twist per unit of the torque that friction holds back"
            return (Weight("compliance", meaning, Load.unit(target)),)
        return (Weight("half_width", "a, half of the loop"),)

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        if target.model != LOCKED:
            return ()
        low, high = Load.share(target, 0.01, 0.5)
        meaning = "w, the load that friction can hold (0.01 to 0.5 of the largest)"
        return (quantity("friction", Load.unit(target), meaning, low, high, linear=False),)

    def column(self, readings: Readings, values: Mapping[str, float], target: Target) -> Array:
        if target.model != LOCKED:
            return np.asarray(readings[Role.DIRECTION], dtype=float)
        load = Load.of(readings)
        return along_path(readings, load, values[self.shape_parameters(target)[0].name]) - load
