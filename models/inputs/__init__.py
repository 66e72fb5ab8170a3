"""Distributions of toleranced inputs; `DISTRIBUTIONS` maps their configuration names."""

from __future__ import annotations

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

DISTRIBUTIONS: dict[str, type[Distribution]] = {
    "uniform": Uniform,
    "triangular": Triangular,
    "trapezoid": Trapezoid,
    "beta": Beta,
    "normal": Normal,
    "truncated_normal": TruncatedNormal,
    "skew_normal": SkewNormal,
    "rayleigh": Rayleigh,
    "empirical": Empirical,
}

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
