"""Drives that yield under the load."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from ...measurable import Role
from ..effect import EffectParameter, Measurements, Target, Values, quantity
from ..inside import CHAINS, InsideSeveral


class GravitySag(InsideSeveral):
    """Drives that yield under the load."""

    name = "gravity_sag"
    family = "manipulator"
    cause = "Drives yield elastically under the static torque of their load."
    formula = "-a_i (m + m0) g dz/dtheta_i on the angle of each arm"
    needs = (Role.PAYLOAD, Role.POSITION)
    mistaken_for = ("base_tilt", "joint_clearance")
    reference = "Mooring, Roth and Driels, Fundamentals of Manipulator Calibration, 1991"

    def numbers(self, target: Target) -> tuple[tuple[EffectParameter, str], ...]:
        meaning = "a, compliance of drive"
        return tuple((quantity(f"compliance_{i}", "mrad/Nm", f"{meaning} {i}"), f"drive_sag_{i}") for i in CHAINS)

    def own_parameters(self, target: Target) -> tuple[EffectParameter, ...]:
        meaning = "m0, mass that the drives carry in addition to the payload"
        mass = quantity("moving_mass", "kg", meaning, 0.0, 100.0, linear=False)
        return (*super().own_parameters(target), mass)

    def factor(self, measurements: Measurements, values: Values) -> Array:
        return np.asarray(measurements[Role.PAYLOAD] + values["moving_mass_kg"])
