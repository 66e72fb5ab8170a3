"""Friction in proportion to the load."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...inputs.distribution import Array
from ...measurable import Role
from ..effect import Readings, Target
from ..shapes import Load, OneColumn, Weight


class LoadFriction(OneColumn):
    """Coulomb friction of loaded contacts, in proportion to the magnitude of the load.

    Reference: Palmgren's torque of a rolling bearing under load, M = mu F d/2 (Harris and
    Kotzalas, Essential Concepts of Bearing Technology, 2006, chapter 10); of a whole drive
    Bittencourt and Gunnarsson, J. Dyn. Syst. Meas. Control 134, 2012.
    """

    name = "load_friction"
    family = "load"
    cause = "Teeth and bearings rub the more, the harder they are pressed."
    formula = "a |T| d"
    needs = (Role.TORQUE, Role.DIRECTION)
    mistaken_for = ("friction_hysteresis", "load_viscous")
    reference = "Bittencourt and Gunnarsson, J. Dyn. Syst. Meas. Control 134, 2012"

    def own_applies(self, target: Target) -> bool:
        return Load.role(target) is not None and Role.DIRECTION in target.roles()

    def weights(self, target: Target) -> tuple[Weight, ...]:
        return (Weight("rate", "a, half of the loop per unit of load", Load.unit(target)),)

    def column(self, readings: Readings, values: Mapping[str, float], target: Target) -> Array:
        return np.asarray(np.abs(Load.of(readings)) * readings[Role.DIRECTION])
