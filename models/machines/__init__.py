"""Machines with a scatter of their own, with and without inspection of every part."""

from .curves import GoodPartsByLimit, GoodPartsBySpread, convex_cost
from .machine import GUARD, SIDES, GoodParts, Inspection, Machine, Rework

__all__ = [
    "GUARD",
    "SIDES",
    "GoodParts",
    "GoodPartsByLimit",
    "GoodPartsBySpread",
    "Inspection",
    "Machine",
    "Rework",
    "convex_cost",
]
