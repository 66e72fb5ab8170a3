"""An adjustment that is not what was commanded."""

from __future__ import annotations

from ..inside import Inside


class AdjustmentGain(Inside):
    """An adjustment that is not what was commanded."""

    name = "adjustment_gain"
    family = "assembly"
    cause = "What is achieved at an adjustment is not what was commanded, but a share of it."
    formula = "achieved = (1 + e) commanded"
    mistaken_for = ("springback",)
    reference = "Mantripragada and Whitney, IEEE Trans. Robot. Autom. 15, 1999"
    inside_bounds = (-1.0, 1.0)
    inside_name = "adjustment_gain_error"
