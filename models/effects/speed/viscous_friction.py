"""Friction in proportion to the speed."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from ...measurable import Role
from ..effect import Measurements, Target, Values
from ..shapes import OneColumn, Weight, speed_unit


class ViscousFriction(OneColumn):
    """Friction in proportion to the speed."""

    name = "viscous_friction"
    family = "speed"
    cause = "Grease is sheared, and its drag is proportional to the speed."
    formula = "a v d"
    needs = (Role.SPEED, Role.DIRECTION)
    mistaken_for = ("read_out_lag", "windage", "friction_hysteresis")
    reference = "Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30, 1994"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("rate", "a, per unit of speed", speed_unit(target)),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.asarray(measurements[Role.SPEED] * measurements[Role.DIRECTION])
