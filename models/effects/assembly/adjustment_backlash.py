"""An adjustment with play."""

from ..inside import Inside


class AdjustmentBacklash(Inside):
    """An adjustment with play."""

    name = "adjustment_backlash"
    family = "assembly"
    cause = "The adjuster has play, and the adjusted part follows only beyond the dead band."
    formula = "dead band of the adjuster"
    mistaken_for = ("adjustment_gain",)
    reference = "Nordin and Gutman, Automatica 38, 2002"
