"""`tolevo gap`: find where simulation and measurement disagree, name the effect, close the gap."""

from .plan import ColumnRole, GapPlan, GapSettings

__all__ = ["ColumnRole", "GapPlan", "GapSettings"]
