"""Allocation of an RV or cycloidal reducer on its exact contact."""

from .problem import RvReducer

__all__ = ["RvReducer"]
