"""Waves of the disc's teeth that grow with the load."""

from __future__ import annotations

from ...inputs.distribution import Array
from ...measurable import Role
from ..effect import Readings, Target
from ..shapes import Load, Orders


class LoadSharing(Orders):
    """Order 78, in proportion to the signed torque."""

    name = "load_sharing"
    family = "load"
    cause = "The two discs share the load unevenly, twice per tooth of a disc."
    formula = "T (c cos 78 theta + s sin 78 theta)"
    needs = (Role.ANGLE, Role.TORQUE)
    mistaken_for = ("two_disc_error", "pitch_defect")
    reference = "Blanche and Yang, J. Mech. Transm. Autom. Des. 111, 1989"
    orders = (78,)

    def per(self, target: Target) -> str:
        return Load.unit(target)

    def factor(self, readings: Readings) -> Array:
        return Load.of(readings)
