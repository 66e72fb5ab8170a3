"""Twist in proportion to the load."""

from __future__ import annotations

from ....arrays import Array
from ..effect import Measurements, Target, Values
from ..shapes import POSITIONS, Load, LoadShape, Weight


class TorsionalCompliance(LoadShape):
    """Elastic twist in proportion to the torque."""

    name = "torsional_compliance"
    family = "load"
    dimensions = POSITIONS
    cause = "Shafts, bearings and housing twist elastically, in proportion to the torque."
    formula = "T/K"
    mistaken_for = ("hertz_stiffening", "bearing_clearance", "lost_motion")
    reference = "Timoshenko, Strength of Materials, 1955"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("compliance", "1/K, twist per unit of torque", Load.unit(target)),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return Load.of(measurements)
