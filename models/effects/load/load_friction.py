"""Friction in proportion to the load."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from ...measurable import Role
from ..effect import Measurements, Target, Values
from ..shapes import Load, LoadShape, Weight


class LoadFriction(LoadShape):
    """Coulomb friction of loaded contacts, in proportion to the magnitude of the load.

    Reference: Palmgren's torque of a rolling bearing under load, M = mu F d/2 (Harris and
    Kotzalas, Essential Concepts of Bearing Technology, 2006, chapter 10); of a whole drive
    Bittencourt and Gunnarsson, J. Dyn. Syst. Meas. Control 134, 2012.
    """

    name = "load_friction"
    family = "load"
    cause = "The friction of teeth and bearings grows with the load."
    formula = "a |T| d"
    needs = (Role.TORQUE, Role.DIRECTION)
    mistaken_for = ("friction_hysteresis", "load_viscous")
    reference = "Bittencourt and Gunnarsson, J. Dyn. Syst. Meas. Control 134, 2012"

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("rate", "a, half of the loop per unit of load", Load.unit(target)),)

    def column(self, measurements: Measurements, values: Values, target: Target) -> Array:
        return np.asarray(np.abs(Load.of(measurements)) * measurements[Role.DIRECTION])
