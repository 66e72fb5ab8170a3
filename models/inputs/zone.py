"""Tolerance zones given by their limits, symmetric or not."""

from __future__ import annotations

import re
from dataclasses import dataclass

_LIMITS = re.compile(r"^\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*/\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*$")


@dataclass(frozen=True, slots=True)
class Zone:
    """The zone mid +- half_width around the nominal value (unit: the caller's)."""

    mid: float
    half_width: float

    @classmethod
    def of_limits(cls, lower: float, upper: float) -> Zone:
        """The zone between a lower and an upper deviation.

        Raises ValueError where the limits are reversed or equal.
        """
        if not lower < upper:
            raise ValueError(f"the lower limit must be below the upper one, got {lower} and {upper}")
        return cls(0.5 * (lower + upper), 0.5 * (upper - lower))

    @classmethod
    def of_text(cls, text: str) -> Zone:
        """The zone that "+0.02/-0.01" (upper/lower deviation, as on a drawing) states."""
        match = _LIMITS.match(text)
        if match is None:
            raise ValueError(f'write limits as "+0.02/-0.01" (upper/lower), got "{text}"')
        first, second = float(match[1]), float(match[2])
        return cls.of_limits(min(first, second), max(first, second))

    @property
    def lower(self) -> float:
        """Lower limit."""
        return self.mid - self.half_width

    @property
    def upper(self) -> float:
        """Upper limit."""
        return self.mid + self.half_width
