"""Tolerance stacks: any requirement on any parts, linearised and as it is."""

from __future__ import annotations

from .linear import Linear, linearised
from .mechanism import Mechanism
from .sampling import Sample, half_width, yield_percent

__all__ = ["Linear", "Mechanism", "Sample", "half_width", "linearised", "yield_percent"]
