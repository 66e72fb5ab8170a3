"""Links and reducers of a serial arm as one machine."""

from .problem import SerialArmAllocation

__all__ = ["SerialArmAllocation"]
