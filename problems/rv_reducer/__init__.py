"""Allocation of an RV or cycloidal reducer on its exact contact."""

from __future__ import annotations

from .problem import RvReducer

__all__ = ["RvReducer"]
