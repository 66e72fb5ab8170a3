"""`tolevo gap`: find where simulation and measurement disagree, identify the effect, close the gap."""

from .plan import ColumnRole, GapPlan, GapSettings

__all__ = ["ColumnRole", "GapPlan", "GapSettings"]
