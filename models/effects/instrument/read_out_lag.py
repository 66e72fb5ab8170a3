"""The output is read late."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...inputs.distribution import Array
from ...measurable import Role
from ..effect import Readings, Target
from ..shapes import OneColumn, Weight, speed_unit


class ReadOutLag(OneColumn):
    """The output is read late."""

    name = "read_out_lag"
    family = "instrument"
    cause = "The reading of the output is some time behind that of the input."
    formula = "a v d"
    needs = (Role.SPEED, Role.DIRECTION)
    mistaken_for = ("viscous_friction", "windage")
    reference = "Franklin, Powell and Workman, Digital Control of Dynamic Systems, 1998"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("rate", "a, per unit of speed", speed_unit(target)),)

    def column(self, readings: Readings, values: Mapping[str, float], target: Target) -> Array:
        return np.asarray(readings[Role.SPEED] * readings[Role.DIRECTION])
