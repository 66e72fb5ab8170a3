"""Machines whose scatter does not depend on the tolerance, with and without inspection."""

from .curves import GoodPartsBySpread, convex_cost
from .machine import Machine

__all__ = ["GoodPartsBySpread", "Machine", "convex_cost"]
