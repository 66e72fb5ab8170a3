"""Tolerance stacks: any requirement on any parts, linearised and as it is."""

from __future__ import annotations

from .law import Law, law_of
from .linear import Linear, linearised
from .mechanism import Mechanism
from .sampling import Sample, half_width, yield_percent

__all__ = [
    "Law",
    "Linear",
    "Mechanism",
    "Sample",
    "half_width",
    "law_of",
    "linearised",
    "yield_percent",
]
