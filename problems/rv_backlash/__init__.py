"""Backlash of an RV reducer against manufacturing cost."""

from .problem import RvBacklash

__all__ = ["RvBacklash"]
