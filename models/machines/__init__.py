"""Machines whose scatter does not depend on the tolerance, with and without inspection."""

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
