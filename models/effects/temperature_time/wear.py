"""Backlash that grows with time."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from ...measurable import Role
from ..effect import Measurements, Target, Values
from ..shapes import POSITIONS, OneColumn, Weight


class Wear(OneColumn):
    """Backlash that grows with time."""

    name = "wear"
    family = "temperature, time"
    dimensions = POSITIONS
    cause = "Flanks wear, and the gap between the two directions grows."
    formula = "a t d"
    needs = (Role.TIME, Role.DIRECTION)
    mistaken_for = ("drift", "friction_hysteresis", "clock_drift")
    reference = "Archard, J. Appl. Phys. 24, 1953"
    weight = Weight("rate", "a, half of the gap per second", "s")

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.asarray(measurements[Role.TIME] * measurements[Role.DIRECTION])
