"""Order of the pins (39): the pin circle runs out."""

from ...gear import PINS
from ..shapes import Orders


class PinCircleRunout(Orders):
    """Order of the pins (39): the pin circle runs out."""

    name = "pin_circle_runout"
    family = "geometry by angle"
    cause = "Every tooth of a disc (39 in the RV-40E) meets the same runout of the pin circle."
    formula = "c cos k theta + s sin k theta, k the order in which pins pass (39)"
    mistaken_for = ("eccentric_error", "pitch_defect", "structural_resonance")
    reference = "Blanche and Yang, J. Mech. Transm. Autom. Des. 111, 1989"
    follows = ((PINS, 1.0),)
