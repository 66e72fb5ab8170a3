"""Links and reducers of a serial arm as one machine."""

from __future__ import annotations

from .problem import SerialArmAllocation

__all__ = ["SerialArmAllocation"]
