"""The best multipliers of a form with open alternatives: the maximum of its Lagrangian dual.

The dual is concave in the multipliers, with any alternatives open. A single factor for all of them,
as the search of `choices` tries, causes a gap of percents where many requirements bind; the maximum
by L-BFGS-B (Byrd, Lu, Nocedal & Zhu 1995) has only the duality gap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from ...problems.forms import Form
from ...problems.spread import Spread
from .prices import Prices, only_roots
from .slsqp import ascend

LITTLE = 1e-6
"""Fraction of the bound that a limit is worth at least, where prices are improved from."""
STEPS = 200
"""Evaluations of the dual at most."""


@dataclass(frozen=True, eq=False)
class Ascent:
    """The dual of a form at one set of limits (r,), with tangents at one reference point."""

    form: Form
    limit: Array
    spread: Spread

    def multipliers(self, first: Array) -> Array:
        """Multipliers (r,) of the largest bound, begun from `first`."""
        asked = np.isfinite(self.limit)
        scale = abs(self.value(first)[0]) or 1.0
        sizes = np.where(asked & (self.limit != 0.0), np.abs(np.where(asked, self.limit, 1.0)), 1.0)
        worth = max(float(np.max(first * sizes, initial=0.0)), LITTLE * scale)
        unit = np.where(first > 0.0, first, 1e-2 * worth / sizes)

        def scaled(y: Array) -> tuple[float, Array]:
            value, slope = self.value(y * unit)
            return value / scale, slope * unit / scale

        start, high = np.where(asked, first / unit, 0.0), np.where(asked, np.inf, 0.0)
        better = ascend(scaled, start, high, slopes=True, maxfun=STEPS) * unit
        return better if self.value(better)[0] >= self.value(first)[0] else first

    def value(self, multiplier: Array) -> tuple[float, Array]:
        """The proven bound, and its slope (r,) by the multipliers."""
        form = self.form
        prices = Prices.at(form, multiplier[None, :], self.limit[None, :], self.spread)
        direction, total = prices.direction[0], 0.0
        linear, square = form.offset.copy(), form.constant.copy()
        for at, feature in enumerate(form.features):
            tolerances, costs = prices.ways(feature, at)
            best = int(np.argmin(costs[:, 0]))
            way, t = feature.ways[best], float(tolerances[best, 0])
            total += float(costs[best, 0])
            m, a = np.array(way.linear), np.array(way.spread)
            linear += (m + direction[:, at] * a) * t + (np.array(way.offset) if way.offset else 0.0)
            square += (a * t) ** 2
        bound = float(prices.bound(form, np.array([total]))[0])
        return bound, self._slope(linear, square)

    def _slope(self, linear: Array, square: Array) -> Array:
        """The excess of every requirement over its limit, of the value or the square that has the price."""
        form, asked = self.form, np.isfinite(self.limit)
        value = self.spread.value[0]
        limit = np.where(asked, self.limit, 0.0)
        room = np.maximum(limit - form.offset, 0.0)
        squared = only_roots(form) & (value > 0.0)
        by_square = (square - room**2) / (2.0 * np.where(value > 0.0, value, 1.0))
        along = linear + self.spread.intercept[0] - limit
        return np.where(asked, np.where(squared, by_square, along), 0.0)
