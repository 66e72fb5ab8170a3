"""Tooth modification of the cycloid discs: backlash against load on the pins."""

from .problem import ToothModification

__all__ = ["ToothModification"]
