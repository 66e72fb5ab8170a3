"""Twist of contacts that stiffen as they flatten."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from ..effect import Measurements, Target, Values
from ..shapes import POSITIONS, Load, LoadShape, Weight


class HertzStiffening(LoadShape):
    """Hertzian twist, with the torque to the power 2/3."""

    name = "hertz_stiffening"
    family = "load"
    dimensions = POSITIONS
    cause = "Contacts flatten under load and stiffen: their approach grows with T^(2/3)."
    formula = "c sgn(T) |T|^(2/3)"
    mistaken_for = ("torsional_compliance", "bearing_clearance", "lost_motion")
    reference = "Johnson, Contact Mechanics, 1985, section 4.2"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight(f"at_1_{Load.unit(target)}", "c, the twist at a load of 1"),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        load = Load.of(measurements)
        return np.asarray(np.sign(load) * np.cbrt(load) ** 2)
