"""A reading that moves with time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...inputs.distribution import Array
from ...measurable import Role
from ..effect import Readings, Target
from ..shapes import OneColumn, Weight


class Drift(OneColumn):
    """A reading that moves with time."""

    name = "drift"
    family = "temperature, time"
    cause = "Something runs away steadily while it is measured."
    formula = "a t"
    needs = (Role.TIME,)
    mistaken_for = ("creep", "wear")
    reference = "JCGM 200:2012, 4.21 instrumental drift"
    along_units = True
    weight = Weight("rate", "a, per second", "s")

    def column(self, readings: Readings, values: Mapping[str, float], target: Target) -> Array:
        return np.asarray(readings[Role.TIME], dtype=float)
