"""Tolerance stacks: any requirement on any parts, linearised and as it is."""

from __future__ import annotations

from .domain import box, least_margin
from .law import Law, law_of
from .linear import Linear, linearised
from .mechanism import Mechanism
from .sampling import Sample, half_width, joint_yield_percent, yield_percent

__all__ = [
    "Law",
    "Linear",
    "Mechanism",
    "Sample",
    "box",
    "half_width",
    "joint_yield_percent",
    "law_of",
    "least_margin",
    "linearised",
    "yield_percent",
]
