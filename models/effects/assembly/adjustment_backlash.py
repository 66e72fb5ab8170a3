"""An adjustment with play."""

from __future__ import annotations

from ..effect import ASSEMBLY
from ..inside import Inside


class AdjustmentBacklash(Inside):
    """An adjustment with play."""

    name, family = "adjustment_backlash", ASSEMBLY
    cause = "The adjuster has play: what it moves follows late."
    formula = "dead band of the adjuster"
    mistaken_for = ("adjustment_gain",)
