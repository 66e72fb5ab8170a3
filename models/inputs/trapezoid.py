"""Trapezoidal input: level in the middle of the zone, falling to its limits."""

from __future__ import annotations

from dataclasses import dataclass, field

from .plateau import Plateau


@dataclass(frozen=True, slots=True)
class Trapezoid(Plateau):
    """z symmetric on [-1, 1] with a level density on [-top, top]: variance (1 + top^2)/6.

    `top` in [0, 1] is the fraction of the zone that is level: 0 is the triangle, 1 is uniform. It
    fills the zone, so it has no Cp and no shift. It is the sum of two independent uniform errors of
    half-widths (1 + top)/2 and (1 - top)/2.

    Reference: JCGM 100:2008 (GUM), 4.3.9.
    """

    top: float = field(default=0.5, metadata={"low": 0.0, "high": 1.0})

    @property
    def level(self) -> tuple[float, float]:
        return -self.top, self.top
