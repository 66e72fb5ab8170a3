"""Tabulated cost curve: grade or tolerance against cost."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np

from ...arrays import Array
from .curve import CostCurve


@dataclass(frozen=True, slots=True)
class Table(CostCurve):
    """Cost at listed tolerances (or grades), linear between them; not defined outside the list.

    `t` rises strictly. Where `cost_at` rises, the lower cost of a tighter tolerance counts, since
    the part may be made to that tolerance. At a listed tolerance the slope is that of the interval
    above it, at the last that of the interval below. Outside the list C is infinite: there is no
    price for that tolerance.
    """

    t: tuple[float, ...]
    cost_at: tuple[float, ...]

    @property
    def least(self) -> tuple[float, ...]:
        """Least cost over each listed tolerance and all tighter ones."""
        return tuple(accumulate(self.cost_at, min))

    @property
    def rising(self) -> tuple[float, ...]:
        """Listed tolerances that cost more than a tighter one."""
        return tuple(t for t, cost, least in zip(self.t, self.cost_at, self.least, strict=True) if cost > least)

    def cost(self, t: Array) -> Array:
        return np.interp(t, self.t, self.least, left=np.inf, right=np.inf)

    def slope(self, t: Array) -> Array:
        knots, slopes = np.array(self.t), np.diff(self.least) / np.diff(self.t)
        at = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(slopes) - 1)
        return np.where((t < knots[0]) | (t > knots[-1]), np.nan, slopes[at])

    @property
    def bends(self) -> tuple[float, ...]:
        slopes = np.diff(self.least) / np.diff(self.t)
        return tuple(t for t, bend in zip(self.t[1:-1], np.diff(slopes), strict=True) if bend < 0.0)

    @property
    def smooth(self) -> bool:
        return len(self.t) == 2

    def best(self, linear: Array, square: Array, low: float, high: float) -> Array:
        """As in the base class; global although a table need not be convex.

        The candidates are the ends, the entries between, and the stationary point of each piece.
        """
        inner = [t for t in self.t if low < t < high]
        knots = np.array([low, *inner, high])
        slopes = self.slope(0.5 * (knots[1:] + knots[:-1]))
        with np.errstate(divide="ignore", invalid="ignore"):
            free = -(slopes[:, None] + linear) / (2.0 * square)
        free = np.clip(np.where(np.isnan(free), low, free), knots[:-1, None], knots[1:, None])
        fixed = np.broadcast_to(knots[:, None], (len(knots), len(linear)))
        candidates = np.vstack([fixed, free])
        values = self.cost(candidates) + linear * candidates + square * candidates**2
        return np.asarray(candidates[np.argmin(values, axis=0), np.arange(len(linear))])

    def faults(self) -> list[tuple[str, str]]:
        if len(self.t) != len(self.cost_at) or len(self.t) < 2:
            return [
                ("t", f"needs at least two entries, and as many as cost_at, got {len(self.t)} and {len(self.cost_at)}")
            ]
        rises = all(before < after for before, after in pairwise(self.t))
        return [] if rises else [("t", "must increase from entry to entry")]
