"""Tooth modification of the cycloid discs: backlash against load on the pins."""

from __future__ import annotations

from .problem import ToothModification

__all__ = ["ToothModification"]
