"""Arms of a wrong length."""

from __future__ import annotations

from math import inf

from ...measurable import Role
from ..effect import EffectParameter, Target, quantity
from ..inside import CHAINS, InsideSeveral


class ArmLengthError(InsideSeveral):
    """Arms of a wrong length."""

    name = "arm_length_error"
    family = "manipulator"
    cause = "The arms are longer or shorter than on the drawing."
    formula = "arm length of each chain"
    needs = (Role.POSITION,)
    mistaken_for = ("thermal_growth", "joint_zero_offset")
    reference = "Mooring, Roth and Driels, Fundamentals of Manipulator Calibration, 1991"

    def numbers(self, target: Target) -> tuple[tuple[EffectParameter, str], ...]:
        return tuple((quantity(f"length_{i}", "um", f"error of arm {i}", -inf), f"arm_length_{i}_um") for i in CHAINS)
