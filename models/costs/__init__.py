"""Cost-tolerance curves; `CURVES` maps their configuration names."""

from __future__ import annotations

from ...registry import Kinds
from .combined import Combined
from .curve import CostCurve
from .exponential import Exponential
from .reciprocal import Reciprocal
from .reciprocal_power import ReciprocalPower
from .reciprocal_squared import ReciprocalSquared
from .table import Table

CURVES: Kinds[CostCurve] = Kinds("curves")
"""Plugins included."""

__all__ = [
    "CURVES",
    "Combined",
    "CostCurve",
    "Exponential",
    "Reciprocal",
    "ReciprocalPower",
    "ReciprocalSquared",
    "Table",
]
