"""Viscous friction that grows with the load."""

from __future__ import annotations

from math import inf

import numpy as np

from ...measurable import Role
from ..effect import Measurements, Target, Values
from ..shapes import Columns, Load, Shape, Weight, speed_unit


class LoadViscous(Shape):
    """Products of load and speed, with the sign of the load and against the motion.

    The first is a compliance that grows with the speed (or a load that is measured late), the
    second the viscous friction of loaded contacts. Reference: Bittencourt and Gunnarsson,
    J. Dyn. Syst. Meas. Control 134, 2012, equation 13; Waiboer, Aarts and Jonker, Multibody
    Dynamics, 2005.
    """

    name = "load_viscous"
    family = "speed"
    cause = "Films between loaded teeth are thinner, and shear more with the speed."
    formula = "a T v + b |T| v d"
    needs = (Role.TORQUE, Role.SPEED, Role.DIRECTION)
    mistaken_for = ("viscous_friction", "load_friction", "torsional_compliance")
    reference = "Bittencourt and Gunnarsson, J. Dyn. Syst. Meas. Control 134, 2012"

    def own_applies(self, target: Target) -> bool:
        return Load.applies(target, self.needs)

    def weights(self, target: Target) -> tuple[Weight, ...]:
        per = f"({Load.unit(target)} {speed_unit(target)})"
        return (
            Weight("signed", "a, with the sign of the load", per, low=-inf),
            Weight("drag", "b, against the motion", per),
        )

    def columns(self, measurements: Measurements, values: Values, target: Target) -> Columns:
        load, speed = Load.of(measurements), np.asarray(measurements[Role.SPEED], dtype=float)
        return {
            "signed": lambda: np.asarray(load * speed),
            "drag": lambda: np.asarray(np.abs(load) * speed * measurements[Role.DIRECTION]),
        }
