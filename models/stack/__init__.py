"""Tolerance stacks: any requirement on any parts, linearised and exact."""

from .conditioned import Conditioned, conditioned
from .domain import box, least_margin, worst_by_corners
from .law import Law, law_of
from .linear import Linear, linearised
from .linear_sum import LinearSum, linear_sum_of
from .made import AsMade, Tolerances, between, limit_of, mean_of, spread_of
from .mechanism import Mechanism
from .sampling import Sample, half_width, joint_yield_percent, yield_percent

__all__ = [
    "AsMade",
    "Conditioned",
    "Law",
    "Linear",
    "LinearSum",
    "Mechanism",
    "Sample",
    "Tolerances",
    "between",
    "box",
    "conditioned",
    "half_width",
    "joint_yield_percent",
    "law_of",
    "least_margin",
    "limit_of",
    "linear_sum_of",
    "linearised",
    "mean_of",
    "spread_of",
    "worst_by_corners",
    "yield_percent",
]
