"""Tolerance stacks: any requirement on any parts, linearised and exact."""

from .conditioned import Conditioned, condition_on_piece
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
    interpolate_designs,
    joint_yield_percent,
    law_of,
    least_margin,
    limit_of,
    linear_model,
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
    "box",
    "condition_on_piece",
    "half_width",
    "interpolate_designs",
    "joint_yield_percent",
    "law_of",
    "least_margin",
    "limit_of",
    "linear_model",
    "linear_sum_of",
    "mean_of",
    "spread_of",
    "worst_by_corners",
    "yield_percent",
]
