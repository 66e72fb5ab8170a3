"""An adjustment that differs from the command."""

from ..inside import Inside


class AdjustmentGain(Inside):
    """An adjustment that differs from the command."""

    name = "adjustment_gain"
    family = "assembly"
    cause = "An adjustment achieves only a fraction of what was commanded."
    formula = "achieved = (1 + e) commanded"
    mistaken_for = ("springback",)
    reference = "Mantripragada and Whitney, IEEE Trans. Robot. Autom. 15, 1999"
    inside_bounds = (-1.0, 1.0)
    inside_name = "adjustment_gain_error"
