"""Statistics over units whose backlash is shifted and scatters more than their contact says.

b' = m + s + (1 + g)(b - m) of every unit (and position, for the root mean square), m the mean.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...arrays import Array
from ...models.rv_reducer.population.measures import Measure, Measures
from ...models.rv_reducer.population.statistics import Statistic, share_within
from .counterparts import Change


class ChangedMeasures(Measures):
    """Statistics by name as those of `plain`, with what effects change outside the contact."""

    def __init__(self, plain: Measures, change: Change) -> None:
        super().__init__(plain.turn, plain.involute, plain.conditions)
        self.plain, self.change = plain, change

    def _computed(self, name: str) -> Measure:
        kind, _, what = name.partition(" ")
        if kind == "interference":
            return self.plain[name]
        if kind == "yield":
            return self._within()
        if kind == "rms":
            return self._rms()
        plain, growth = self.plain[name], self.change.growth
        if kind == "deviation":
            return replace(plain, statistic=_combined((plain.statistic, 1.0 + growth)))
        middle = self.plain[f"mean {what}"]
        parts = (plain.statistic, 1.0 + growth), (middle.statistic, -growth)
        return replace(plain, statistic=_combined(*parts, shift=self.change.effective))

    def _within(self) -> Measure:
        """The fraction of units that keep the limit: those whose contact keeps another limit."""
        middle, involute = self.plain["mean max"], self.involute
        factor, mean = 1.0 + self.change.growth, middle.statistic.value
        limit = self.conditions.limit
        kept = mean + (limit - self.change.effective - mean) / factor
        within = share_within(self.largest, involute, kept)
        density = -float(within.weight.sum())
        by_mean = density * self.change.growth / factor
        moved = replace(middle.statistic, value=0.0, error=0.0)
        return replace(middle, statistic=_combined((within, 1.0), (moved, by_mean)))

    def _rms(self) -> Measure:
        """sqrt((1 + g)^2 (r^2 - m^2) + (m + s)^2) of the root mean square r and the mean m."""
        rms, mean = self.plain["rms"], self.plain["mean mean"]
        r, m = rms.statistic, mean.statistic
        square, moved = (1.0 + self.change.growth) ** 2, m.value + self.change.effective
        value = float(np.sqrt(square * (r.value**2 - m.value**2) + moved**2))
        by_rms, by_mean = square * r.value / value, (moved - square * m.value) / value

        def spread(_: Array) -> Array:
            return np.asarray(by_rms * rms.spread(r.weight) + by_mean * mean.spread(m.weight))

        involute = by_rms * r.by_involute + by_mean * m.by_involute
        error = abs(by_rms) * r.error + abs(by_mean) * m.error
        return Measure(Statistic(value, r.weight, involute, error), spread)


def _combined(*parts: tuple[Statistic, float], shift: float = 0.0) -> Statistic:
    """The sum of statistics of the same units times factors; its error is at most that stated."""
    return Statistic(
        sum(factor * statistic.value for statistic, factor in parts) + shift,
        np.sum([factor * statistic.weight for statistic, factor in parts], axis=0),
        sum(factor * statistic.by_involute for statistic, factor in parts),
        sum(abs(factor) * statistic.error for statistic, factor in parts),
    )
