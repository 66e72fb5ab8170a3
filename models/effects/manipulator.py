"""Effects inside a parallel manipulator: lengths, zeros, play and yield of its chains."""

from __future__ import annotations

from math import inf

import numpy as np

from ...section import Array
from ..measurable import Role
from .effect import CHAINS, EffectParameter, Inside, InsideSeveral, Measurements, Target, Values, quantity
from .shapes import warming


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


class JointClearance(Inside):
    """Joints with play."""

    name = "joint_clearance"
    family = "manipulator"
    cause = "The joints have play, and the weight of the platform determines the side of contact."
    formula = "each rod longer by c in tension, shorter by c in compression"
    needs = (Role.POSITION,)
    mistaken_for = ("gravity_sag", "arm_length_error")
    reference = "Innocenti, J. Mech. Des. 124, 2002"


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


class ThermalGrowth(InsideSeveral):
    """Links and base grow with temperature."""

    name = "thermal_growth"
    family = "manipulator"
    cause = "Links and base warm up equally, and all lengths grow by the same factor."
    formula = "all lengths times 1 + a tau"
    needs = (Role.TEMPERATURE, Role.POSITION)
    mistaken_for = ("arm_length_error",)
    reference = "ISO 230-3:2020"

    def numbers(self, target: Target) -> tuple[tuple[EffectParameter, str], ...]:
        meaning = "a, expansion per kelvin above 20 degC"
        return ((quantity("expansion_per_K", "ppm", meaning), "growth_ppm"),)

    def factor(self, measurements: Measurements, values: Values) -> Array:
        return warming(measurements)
