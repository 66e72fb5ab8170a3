"""Pose accuracy of the parallel manipulator with full-circle rotation against cost."""

from .problem import PoseAccuracy

__all__ = ["PoseAccuracy"]
