"""A gap that is crossed with the sign of the load."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from ..effect import Measurements, Target, Values
from ..shapes import POSITIONS, Load, LoadShape, Weight


class LostMotion(LoadShape):
    """Offset with the sign of the torque."""

    name = "lost_motion"
    family = "load"
    dimensions = POSITIONS
    cause = "A gap is crossed when the torque changes its sign."
    formula = "c sgn(T)"
    mistaken_for = ("bearing_clearance", "friction_hysteresis", "hertz_stiffening")
    reference = "Nordin and Gutman, Automatica 38, 2002"
    weight = Weight("half_width", "c, half of the lost motion")

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.sign(Load.of(measurements))
