"""Pose accuracy of the parallel manipulator with full-circle rotation against cost."""

from __future__ import annotations

from .problem import PoseAccuracy

__all__ = ["PoseAccuracy"]
