"""Links and reducers of the manipulator as one machine."""

from __future__ import annotations

from .problem import RobotJoint

__all__ = ["RobotJoint"]
