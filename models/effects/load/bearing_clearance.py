"""A dead band that is crossed over a small load."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from ..effect import EffectParameter, Measurements, Target, Values, quantity
from ..shapes import POSITIONS, Load, LoadShape, Weight


class BearingClearance(LoadShape):
    """Dead band: the clearance is taken up over a small torque."""

    name = "bearing_clearance"
    family = "load"
    dimensions = POSITIONS
    cause = "Rolling elements are loaded one after another until the clearance is taken up."
    formula = "c clip(T/T0, -1, 1)"
    mistaken_for = ("lost_motion", "torsional_compliance", "hertz_stiffening")
    reference = "Harris and Kotzalas, Essential Concepts of Bearing Technology, 2006"
    weight = Weight("half_width", "c, half of the dead band")

    def shape_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        low, high = Load.share(target, 0.02, 0.5)
        meaning = "T0, the load that takes up the clearance (0.02 to 0.5 of the largest)"
        return (quantity("load", Load.unit(target), meaning, low, high, linear=False),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        up = values[self.shape_parameters(target)[0].name]
        return np.clip(Load.of(measurements) / max(up, np.finfo(float).tiny), -1.0, 1.0)
