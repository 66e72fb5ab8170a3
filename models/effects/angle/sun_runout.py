"""Orders of the sun (120 and 121): the sun gear runs out."""

from ...gear import SUN, SUN_OVER_CARRIER
from ..shapes import Orders


class SunRunout(Orders):
    """Orders of the sun (120 and 121): the sun gear runs out."""

    name = "sun_runout"
    family = "geometry by angle"
    cause = "The sun turns 121 times (RV-40E) per turn of the output, 120 against the carrier."
    formula = "the orders of the sun against the carrier and in the housing (120 and 121), as above"
    mistaken_for = ("structural_resonance",)
    reference = "Smith, Gear Noise and Vibration, 2003"
    follows = ((SUN_OVER_CARRIER, 1.0), (SUN, 1.0))
