"""A base that is tilted."""

from __future__ import annotations

from math import inf

from ...measurable import Role
from ..effect import EffectParameter, Target, quantity
from ..inside import InsideSeveral


class BaseTilt(InsideSeveral):
    """A base that is tilted."""

    name = "base_tilt"
    family = "manipulator"
    cause = "The base, or the frame of the measurement, is rotated about its x and y."
    formula = "rotation of the machine about x and y of its base"
    needs = (Role.ANGLE, Role.POSITION)
    mistaken_for = ("joint_zero_offset", "gravity_sag")
    reference = "Mooring, Roth and Driels, Fundamentals of Manipulator Calibration, 1991"

    def numbers(self, target: Target) -> tuple[tuple[EffectParameter, str], ...]:
        return tuple(
            (quantity(axis, "mrad", f"rotation about the base's {axis}", -inf), f"tilt_{axis}_mrad") for axis in "xy"
        )
