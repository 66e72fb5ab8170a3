"""One wave per turn of an arm."""

from __future__ import annotations

from math import inf

from ...measurable import Role
from ..effect import EffectParameter, Target, quantity
from ..inside import CHAINS, InsideSeveral


class DriveEccentricity(InsideSeveral):
    """One wave per turn of an arm."""

    name = "drive_eccentricity"
    family = "manipulator"
    cause = "The wheel or encoder of a drive is mounted off its axis."
    formula = "c cos theta_i + s sin theta_i on the angle of each arm"
    needs = (Role.ANGLE, Role.POSITION)
    mistaken_for = ("joint_zero_offset",)
    reference = "Mooring, Roth and Driels, Fundamentals of Manipulator Calibration, 1991"

    def numbers(self, target: Target) -> tuple[tuple[EffectParameter, str], ...]:
        return tuple(
            (quantity(f"{part}_{i}", "mrad", f"component of drive {i}", -inf), f"{part}_{i}_mrad")
            for i in CHAINS
            for part in ("drive_cos", "drive_sin")
        )
