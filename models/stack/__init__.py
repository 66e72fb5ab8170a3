"""Tolerance stacks: any requirement on any parts, linearised and exact."""

from .domain import box, least_margin, worst_by_corners
from .law import Law, law_of
from .linear import Linear, linearised
from .made import AsMade, Tolerances, between, limit_of, mean_of, spread_of
from .mechanism import Mechanism
from .sampling import Sample, half_width, joint_yield_percent, yield_percent

__all__ = [
    "AsMade",
    "Law",
    "Linear",
    "Mechanism",
    "Sample",
    "Tolerances",
    "between",
    "box",
    "half_width",
    "joint_yield_percent",
    "law_of",
    "least_margin",
    "limit_of",
    "linearised",
    "mean_of",
    "spread_of",
    "worst_by_corners",
    "yield_percent",
]
