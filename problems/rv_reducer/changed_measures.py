"""Statistics over units whose backlash is shifted and scatters more than their contact says.

b' = m + s + (1 + g)(b - m) of every unit (and position, for the root mean square), m the mean. What
interferes is counted on y' of the same rule, y the signed backlash of the cycloid stage and m its
mean over units and positions; a gap elsewhere is in s of the backlash, and moves no flank.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from functools import cached_property

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
        return RULES[name.partition(" ")[0]](self, name)

    def _deviation(self, name: str) -> Measure:
        plain = self.plain[name]
        return replace(plain, statistic=_combined((plain.statistic, 1.0 + self.change.growth)))

    def _about_mean(self, name: str) -> Measure:
        plain, middle, growth = self.plain[name], self.plain[f"mean {name.partition(' ')[2]}"], self.change.growth
        parts = (plain.statistic, 1.0 + growth), (middle.statistic, -growth)
        return replace(plain, statistic=_combined(*parts, shift=self.change.effective))

    def _signed(self, name: str) -> Measure:
        """A statistic of y, in which flanks that interfere are below zero."""
        if self.change.shift == 0.0 and self.change.growth == 0.0:
            return self.plain[name]
        moved, growth = self._moved[name], self.change.growth

        def spread(weight: Array) -> Array:
            by_place = moved.spread(weight)
            return np.asarray((1.0 + growth) * by_place - growth * by_place.mean())

        return Measure(moved.statistic, spread)

    @cached_property
    def _moved(self) -> Measures:
        """Statistics of the same units at y'."""
        play, factor = self.turn.play.astype(np.float64), 1.0 + self.change.growth
        mean = float(play.mean())
        changed = mean + self.change.shift + factor * (play - mean)
        turn = replace(self.turn, play=changed.astype(np.float32))
        return Measures(turn, self.involute, self.conditions, factor)

    def _within(self, _: str) -> Measure:
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

    def _mean_square(self, _: str) -> Measure:
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


RULES: Mapping[str, Callable[[ChangedMeasures, str], Measure]] = {
    "quantile": ChangedMeasures._about_mean,
    "mean": ChangedMeasures._about_mean,
    "deviation": ChangedMeasures._deviation,
    "yield": ChangedMeasures._within,
    "rms": ChangedMeasures._mean_square,
    "interference": ChangedMeasures._signed,
    "overlap": ChangedMeasures._signed,
}
"""What effects outside the contact do to each kind of statistic."""


def unruled(measures: Mapping[str, str], outputs: Iterable[str], under_load: Collection[str]) -> list[str]:
    """Outputs of which nothing says what effects outside the contact do to them.

    Those under load keep to the contact: no shift of backlash is a shift of torque.
    """
    kinds = {output: measures.get(output, "").partition(" ")[0] for output in outputs if output not in under_load}
    return sorted(output for output, kind in kinds.items() if kind not in RULES)


def _combined(*parts: tuple[Statistic, float], shift: float = 0.0) -> Statistic:
    """The sum of statistics of the same units times factors; its error is at most that stated."""
    return Statistic(
        sum(factor * statistic.value for statistic, factor in parts) + shift,
        np.sum([factor * statistic.weight for statistic, factor in parts], axis=0),
        sum(factor * statistic.by_involute for statistic, factor in parts),
        sum(abs(factor) * statistic.error for statistic, factor in parts),
    )
