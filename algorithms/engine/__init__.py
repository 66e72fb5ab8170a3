"""Evolutionary algorithms on plain arrays: every step works on the whole population at once."""

from __future__ import annotations

from .base import ArrayEngine, Space
from .gde3 import GDE3Engine
from .nsga2 import NSGA2Engine

ENGINES = ("gde3", "nsga2")
"""Names of the registered algorithms that have an array engine."""

__all__ = ["ENGINES", "ArrayEngine", "GDE3Engine", "NSGA2Engine", "Space"]
