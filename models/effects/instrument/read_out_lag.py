"""The output is recorded late."""

from __future__ import annotations

from math import inf

import numpy as np

from ....arrays import Array
from ...measurable import Role
from ..effect import Measurements, Target, Values
from ..shapes import POSITIONS, OneColumn, Weight, speed_unit


class ReadOutLag(OneColumn):
    """The output is recorded late, or its input is.

    An output that grows with the motion lags by v times the delay (a < 0); in a difference
    in/i - out, such as the transmission error, a late output has the opposite sign (a > 0).
    """

    name = "read_out_lag"
    family = "instrument"
    dimensions = POSITIONS
    cause = "The output is recorded some time after the input."
    formula = "a v d"
    needs = (Role.SPEED, Role.DIRECTION)
    mistaken_for = ("viscous_friction", "windage")
    reference = "Franklin, Powell and Workman, Digital Control of Dynamic Systems, 1998"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("rate", "a, per unit of speed", speed_unit(target), -inf),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.asarray(measurements[Role.SPEED] * measurements[Role.DIRECTION])
