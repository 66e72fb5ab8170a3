"""Drag with the square of the speed."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from ...measurable import Role
from ..effect import Measurements, Target, Values
from ..shapes import OneColumn, Weight, speed_unit


class Windage(OneColumn):
    """Drag with the square of the speed."""

    name = "windage"
    family = "speed"
    cause = "Air and oil are displaced, with a drag that grows with the square of the speed."
    formula = "a v^2 d"
    needs = (Role.SPEED, Role.DIRECTION)
    mistaken_for = ("viscous_friction", "read_out_lag")
    reference = "Townsend, Dudley's Gear Handbook, 1991"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("rate", "a, per squared unit of speed", _squared(speed_unit(target))),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.asarray(measurements[Role.SPEED] ** 2 * measurements[Role.DIRECTION])


def _squared(unit: str) -> str:
    return "rpm^2" if unit == "rpm" else "(m/s)^2"
