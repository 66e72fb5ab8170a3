"""Order 39: the pin circle runs out."""

from __future__ import annotations

from ..shapes import Orders


class PinCircleRunout(Orders):
    """Order 39: the pin circle runs out."""

    name = "pin_circle_runout"
    family = "geometry by angle"
    cause = "Each of the 39 teeth of a disc meets the same runout of the pin circle."
    formula = "c cos 39 theta + s sin 39 theta"
    mistaken_for = ("eccentric_error", "pitch_defect", "structural_resonance")
    reference = "Blanche and Yang, J. Mech. Transm. Autom. Des. 111, 1989"
    orders = (39,)
