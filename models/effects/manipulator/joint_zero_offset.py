"""Drives whose zeros are off."""

from __future__ import annotations

from math import inf

from ...measurable import Role
from ..effect import EffectParameter, Target, quantity
from ..inside import CHAINS, InsideSeveral


class JointZeroOffset(InsideSeveral):
    """Drives whose zeros are off."""

    name = "joint_zero_offset"
    family = "manipulator"
    cause = "The zeros of the drives were set incorrectly."
    formula = "drive zero of each chain"
    needs = (Role.POSITION,)
    mistaken_for = ("drive_eccentricity", "base_tilt")
    reference = "Mooring, Roth and Driels, Fundamentals of Manipulator Calibration, 1991"

    def numbers(self, target: Target) -> tuple[tuple[EffectParameter, str], ...]:
        return tuple(
            (quantity(f"zero_{i}", "mrad", f"zero of drive {i}", -inf), f"drive_zero_{i}_mrad") for i in CHAINS
        )
