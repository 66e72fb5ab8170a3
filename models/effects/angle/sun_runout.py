"""Orders 120 and 121: the sun gear runs out."""

from __future__ import annotations

from ..shapes import Orders


class SunRunout(Orders):
    """Orders 120 and 121: the sun gear runs out."""

    name = "sun_runout"
    family = "geometry by angle"
    cause = "The sun turns 121 times per turn of the output, and 120 times against the cranks."
    formula = "orders 120 and 121, as above"
    mistaken_for = ("structural_resonance",)
    reference = "Smith, Gear Noise and Vibration, 2003"
    orders = (120, 121)
