"""Distributions of toleranced inputs; `DISTRIBUTIONS` maps their configuration names."""

from __future__ import annotations

from ...registry import Kinds
from .beta import Beta
from .distribution import Distribution
from .empirical import Empirical
from .normal import Normal
from .rayleigh import Rayleigh
from .skew_normal import SkewNormal
from .trapezoid import Trapezoid
from .triangular import Triangular
from .truncated_normal import TruncatedNormal
from .uniform import Uniform
from .zone import Zone

DISTRIBUTIONS: Kinds[Distribution] = Kinds("distributions")
"""Plugins included."""

__all__ = [
    "DISTRIBUTIONS",
    "Beta",
    "Distribution",
    "Empirical",
    "Normal",
    "Rayleigh",
    "SkewNormal",
    "Trapezoid",
    "Triangular",
    "TruncatedNormal",
    "Uniform",
    "Zone",
]
