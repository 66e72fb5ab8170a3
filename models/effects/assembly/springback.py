"""Adjustments that return."""

from ..inside import Inside


class Springback(Inside):
    """Adjustments that return."""

    name = "springback"
    family = "assembly"
    cause = "A fraction of the total adjustment returns after the last step."
    formula = "-a fraction of the total adjustment, after the last step"
    mistaken_for = ("adjustment_gain", "chain_coupling")
    reference = "Mantripragada and Whitney, IEEE Trans. Robot. Autom. 15, 1999"
    inside_bounds = (0.0, 1.0)
