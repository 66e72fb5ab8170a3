"""A clock that drifts."""

from __future__ import annotations

from math import inf

import numpy as np

from ....arrays import Array
from ...measurable import Role
from ..effect import Measurements, Target, Values
from ..shapes import POSITIONS, OneColumn, Weight, speed_unit


class ClockDrift(OneColumn):
    """A clock that drifts."""

    name = "clock_drift"
    family = "instrument"
    dimensions = POSITIONS
    cause = "The clocks of input and output diverge, and the output is recorded later and later."
    formula = "a t v d"
    needs = (Role.TIME, Role.SPEED, Role.DIRECTION)
    mistaken_for = ("wear", "read_out_lag")
    reference = "IEEE 1588-2019"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("rate", "a, per unit of speed and second", f"({speed_unit(target)} s)", -inf),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.asarray(measurements[Role.TIME] * measurements[Role.SPEED] * measurements[Role.DIRECTION])
