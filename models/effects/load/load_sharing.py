"""Waves of the disc's teeth that grow with the load."""

from __future__ import annotations

from ....arrays import Array
from ...gear import PINS
from ...measurable import Role
from ..effect import Measurements, Target
from ..shapes import Load, Orders


class LoadSharing(Orders):
    """Twice the order of the pins (78), in proportion to the signed torque."""

    name = "load_sharing"
    family = "load"
    cause = "The two discs share the load unevenly, twice per tooth of a disc."
    formula = "T (c cos k theta + s sin k theta), k twice the order in which pins pass (78)"
    needs = (Role.ANGLE, Role.TORQUE)
    mistaken_for = ("two_disc_error", "pitch_defect")
    reference = "Blanche and Yang, J. Mech. Transm. Autom. Des. 111, 1989"
    follows = ((PINS, 2.0),)

    def per(self, target: Target) -> str:
        return Load.unit(target)

    def factor(self, measurements: Measurements) -> Array:
        return Load.of(measurements)
