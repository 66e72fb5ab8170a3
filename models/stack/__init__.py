"""Tolerance stacks: any requirement on any parts, linearised and exact."""

from .conditioned import Conditioned, conditioned
from .linear_sum import LinearSum, linear_sum_of
from .mechanism import (
    AsMade,
    Law,
    Linear,
    Mechanism,
    Sample,
    Tolerances,
    between,
    box,
    half_width,
    joint_yield_percent,
    law_of,
    least_margin,
    limit_of,
    linearised,
    mean_of,
    spread_of,
    worst_by_corners,
    yield_percent,
)

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
