"""A tolerance that machines make: its ways, the scatter of its good parts, and what they cost."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Array, Integers
from ..models.costs import CostCurve
from ..models.machines import GoodPartsBySpread
from ..models.machines.offers import Offer, Way

SCALE = 3.0
"""Half-widths of a normal input with Cp = 1 per standard deviation."""


@dataclass(frozen=True, eq=False)
class MachinedTolerance:
    """A tolerance that is made by machines: the ways to use them, and the variable that chooses."""

    name: str
    offers: tuple[Offer, ...]

    @property
    def choice(self) -> str:
        """Name of the variable that chooses a way."""
        return f"{self.name.removesuffix('_um').removesuffix('_mrad')}_process"

    @cached_property
    def ways(self) -> tuple[Way, ...]:
        """Every machine with and without inspection."""
        return tuple(way for offer in self.offers for way in offer.ways())

    @property
    def low(self) -> float:
        """Tightest limit of any way."""
        return min(way.low for way in self.ways)

    @property
    def high(self) -> float:
        """Loosest limit of any way."""
        return max(way.high for way in self.ways)

    def by_spread(self, way: Way) -> GoodPartsBySpread:
        """An inspected way by the spread of its good parts, in half-widths."""
        return GoodPartsBySpread(way.machine, way.low, way.high, SCALE)

    def clipped(self, t: Array, chosen: Integers) -> Array:
        """Limits (n,) moved to the nearest that the chosen way holds."""
        low, high = (np.array([getattr(way, end) for way in self.ways]) for end in ("low", "high"))
        return np.clip(t, low[chosen], high[chosen])

    def spread_and_mean(self, t: Array, chosen: Integers) -> tuple[Array, Array]:
        """Half-width of a normal input with the scatter of good parts, and their mean (n,)."""
        return self.by_way(
            t, chosen, lambda way, t: (SCALE * way.machine.good_parts(t).std, way.machine.good_parts(t).mean)
        )

    def slopes(self, t: Array, chosen: Integers) -> tuple[Array, Array]:
        """Derivatives of the two by the limit (n,)."""
        return self.by_way(
            t,
            chosen,
            lambda way, t: (SCALE * way.machine.good_parts(t).std_slope, way.machine.good_parts(t).mean_slope),
        )

    def cost(self, t: Array, chosen: Integers) -> tuple[Array, Array]:
        """Cost of a good part, and its derivative by the limit (n,)."""
        return self.by_way(t, chosen, lambda way, t: (way.curve.cost(t), way.curve.slope(t)))

    def by_way(self, t: Array, chosen: Integers, values: Any) -> tuple[Array, Array]:
        """Two values (n,) of each design by its way."""
        first, second = np.zeros_like(t), np.zeros_like(t)
        for number, way in enumerate(self.ways):
            rows = chosen == number
            if np.any(rows):
                first[rows], second[rows] = values(way, t[rows])
        return first, second

    def limits(self, spread: Array, chosen: Integers) -> Array:
        """Limits (n,) at spreads (n,) of good parts."""
        return self.by_way(
            spread, chosen, lambda way, x: (way.low if way.low == way.high else self.by_spread(way).limit(x), 0.0)
        )[0]


def curve_of(tolerance: MachinedTolerance, way: Way, low: float, high: float) -> CostCurve:
    """Cost of a way against the spread of its good parts."""
    return way.curve if low == high else tolerance.by_spread(way)
