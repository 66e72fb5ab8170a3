"""Distributions of toleranced inputs; `DISTRIBUTIONS` maps their configuration names."""

from __future__ import annotations

from .distribution import Distribution
from .normal import Normal
from .truncated_normal import TruncatedNormal
from .uniform import Uniform
from .zone import Zone

DISTRIBUTIONS: dict[str, type[Distribution]] = {
    "uniform": Uniform,
    "normal": Normal,
    "truncated_normal": TruncatedNormal,
}

__all__ = ["DISTRIBUTIONS", "Distribution", "Normal", "TruncatedNormal", "Uniform", "Zone"]
