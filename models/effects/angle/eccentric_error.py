"""Order 40: the cranks are eccentric by a wrong amount."""

from __future__ import annotations

from ..shapes import Orders


class EccentricError(Orders):
    """Order 40: the cranks are eccentric by a wrong amount."""

    name = "eccentric_error"
    family = "geometry by angle"
    cause = "A crank turns 40 times per turn of the output and brings its error along."
    formula = "c cos 40 theta + s sin 40 theta"
    mistaken_for = ("pin_circle_runout", "structural_resonance")
    reference = "Blanche and Yang, J. Mech. Transm. Autom. Des. 111, 1989"
    orders = (40,)
