"""Triangular input: most units near a value of the zone, none beyond its limits."""

from __future__ import annotations

from dataclasses import dataclass, field

from .plateau import Plateau


@dataclass(frozen=True, slots=True)
class Triangular(Plateau):
    """z triangular on [-1, 1] with its peak at `mode`: mean mode/3, variance (3 + mode^2)/18.

    It fills the zone, so it has no Cp and no shift; `mode` in [-1, 1] is 0 (symmetric) by default.

    Reference: Johnson, Kotz & Balakrishnan (1995), Continuous Univariate Distributions II, 26.9.
    """

    mode: float = field(default=0.0, metadata={"low": -1.0, "high": 1.0})

    @property
    def level(self) -> tuple[float, float]:
        return self.mode, self.mode
