"""Order of the cranks (40): they are eccentric by a wrong amount."""

from ...gear import CRANK
from ..shapes import Orders


class EccentricError(Orders):
    """Order of the cranks (40): they are eccentric by a wrong amount."""

    name = "eccentric_error"
    family = "geometry by angle"
    cause = "The error of a crank recurs many times (RV-40E: 40) per turn of the output."
    formula = "c cos k theta + s sin k theta, k the order of the cranks (40)"
    mistaken_for = ("pin_circle_runout", "structural_resonance")
    reference = "Blanche and Yang, J. Mech. Transm. Autom. Des. 111, 1989"
    follows = ((CRANK, 1.0),)
