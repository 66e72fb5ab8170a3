"""Tolerance stacks: any requirement on any parts, linearised and exact."""

from .conditioned import Conditioned
from .conditioned import condition_on_piece as conditioned
from .linear_sum import LinearSum, linear_sum_of
from .mechanism import (
    AsMade,
    Law,
    Linear,
    Mechanism,
    Sample,
    Tolerances,
    box,
    half_width,
    joint_yield_percent,
    law_of,
    least_margin,
    limit_of,
    mean_of,
    spread_of,
    worst_by_corners,
    yield_percent,
)
from .mechanism import interpolate_designs as between
from .mechanism import linear_model as linearised

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
