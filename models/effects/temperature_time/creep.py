"""A measurement that settles logarithmically."""

from __future__ import annotations

from math import inf

import numpy as np

from ....arrays import Array
from ...measurable import Role
from ..effect import EffectParameter, Measurements, Target, Values, quantity
from ..shapes import OneColumn, Weight


class Creep(OneColumn):
    """A measurement that settles logarithmically."""

    name = "creep"
    family = "temperature, time"
    cause = "Grease and joints settle under load, ever more slowly."
    formula = "a ln(1 + t/t0)"
    needs = (Role.TIME,)
    mistaken_for = ("drift", "wear")
    reference = "Nabarro, Mater. Sci. Eng. A 309, 2001"
    weight = Weight("rate", "a, per factor e of time")

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        last = target.largest.get(Role.TIME, 0.0)
        low, high = (1e-4 * last, 0.5 * last) if last > 0.0 else (0.0, inf)
        return (quantity("begin", "s", "t0, when it begins to slow down", low, high, linear=False),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        since = np.maximum(measurements[Role.TIME], 0.0)  # before its beginning nothing creeps
        return np.asarray(np.log1p(since / max(values["begin_s"], np.finfo(float).tiny)))
