"""Any mechanism that is written in its configuration."""

from .definition import Correlation, Definition, Part, Process, Requirement
from .problem import Stack

__all__ = ["Correlation", "Definition", "Part", "Process", "Requirement", "Stack"]
