"""Backlash of an RV reducer against manufacturing cost."""

from __future__ import annotations

from .problem import RvBacklash

__all__ = ["RvBacklash"]
