"""Twice the orders of pins and cranks (78, 80): errors common to both discs."""

from ...gear import CRANK, PINS
from ..shapes import Orders


class TwoDiscError(Orders):
    """Twice the orders of pins and cranks (78, 80): errors common to both discs."""

    name = "two_disc_error"
    family = "geometry by angle"
    cause = "Two discs half a turn apart cancel odd waves and double what is common to both."
    formula = "twice the orders of pins and cranks (78 and 80), as above"
    mistaken_for = ("load_sharing", "pitch_defect", "structural_resonance")
    reference = "Blanche and Yang, J. Mech. Transm. Autom. Des. 111, 1989"
    follows = ((PINS, 2.0), (CRANK, 2.0))
