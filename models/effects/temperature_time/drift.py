"""A measurement that changes with time."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from ...measurable import Role
from ..effect import Measurements, Target, Values
from ..shapes import OneColumn, Weight


class Drift(OneColumn):
    """A measurement that changes with time."""

    name = "drift"
    family = "temperature, time"
    cause = "The measured quantity changes steadily during the measurement."
    formula = "a t"
    needs = (Role.TIME,)
    mistaken_for = ("creep", "wear")
    reference = "JCGM 200:2012, 4.21 instrumental drift"
    along_units = True
    weight = Weight("rate", "a, per second", "s")

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.asarray(measurements[Role.TIME], dtype=float)
