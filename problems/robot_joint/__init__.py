"""Links and reducers of the manipulator as one machine."""

from .problem import RobotJoint

__all__ = ["RobotJoint"]
