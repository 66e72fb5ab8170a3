"""What effects do to units on their exact contact."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...models.effects.measurements import Active
from ...models.rv_reducer.contact.geometry import ContactGeometry
from ...models.rv_reducer.cycloid import pin_circle_growth
from ...models.rv_reducer.population.measures import Measure, Measures
from ...models.rv_reducer.population.units import Statistic, share_within
from ...section import Array, Value, number
from ...units import ARCMIN, UM


@dataclass(frozen=True, slots=True)
class Change:
    """What effects change: `circle` [um] is the growth of the pin circle relative to the discs,
    `bearing` [um] a clearance of every crank bearing and `wear` [um] what flanks of teeth and pins have
    lost together, all inside the contact. Outside of it every
    unit has `gap` [arcmin] of backlash more, which moves no flank, and units differ from those of
    the drawing: they are off by `shift` [arcmin] and scatter by the fraction `growth` more.
    """

    circle: float = 0.0
    bearing: float = 0.0
    wear: float = 0.0
    gap: float = 0.0
    shift: float = 0.0
    growth: float = 0.0

    def __add__(self, other: Change) -> Change:
        return Change(
            self.circle + other.circle,
            self.bearing + other.bearing,
            self.wear + other.wear,
            self.gap + other.gap,
            self.shift + other.shift,
            (1.0 + self.growth) * (1.0 + other.growth) - 1.0,
        )

    @property
    def effective(self) -> float:
        """What is added to the backlash of every unit outside the contact [arcmin]."""
        return self.gap + self.shift

    @property
    def inside(self) -> Mapping[str, float]:
        """What is added to mid-limits [um], by name of the error."""
        return {"pin_circle_radius": self.circle, "crank_bearing": self.bearing, "equidistance": self.wear}

    @property
    def outside(self) -> bool:
        """Whether anything is changed outside the contact."""
        return self.effective != 0.0 or self.growth != 0.0


def _expansion(values: Mapping[str, float], geometry: ContactGeometry) -> Change:
    warmer = np.array(values.get("temperature_difference_K", 0.0))
    growth = pin_circle_growth(geometry.nominal, warmer, np.array(0.0))
    return Change(circle=float(growth) / UM)


def _shift(values: Mapping[str, float], _: ContactGeometry) -> Change:
    return Change(shift=values.get("shift_arcmin", 0.0))


def _inflation(values: Mapping[str, float], _: ContactGeometry) -> Change:
    return Change(growth=values.get("growth", 0.0))


def _gap(values: Mapping[str, float], _: ContactGeometry) -> Change:
    """Both halves of a gap that is crossed when the torque changes its sign."""
    return Change(bearing=values.get("bearing_clearance_um", 0.0), gap=2.0 * values.get("half_width_arcmin", 0.0))


def worn(parameters: Mapping[str, Value], hours: float) -> Change:
    """Flank wear after some hours: running in, then at a constant rate.

    w = w_0 (1 - exp(-t/t_0)) + k t. By Archard's law k is in proportion to load times sliding; it is
    scaled by the measured growth of the lost motion. In a turn every pin and tooth carries every phase
    of the mesh once, so that all wear alike: w acts on backlash, not on pitch. It counts as even along
    the flanks. Reference: Archard, J. Appl. Phys. 24, 1953.
    """
    running_in, constant = number(parameters["running_in_um"]), number(parameters["running_in_hours"])
    rate = 1e-3 * number(parameters["wear_um_per_1000h"])
    return Change(wear=running_in * (1.0 - math.exp(-hours / constant)) + rate * hours)


def _wear(values: Mapping[str, float], geometry: ContactGeometry) -> Change:
    """Both halves of a gap that has grown for `hours`, as wear of the flanks that leaves it."""
    gap = 2.0 * values.get("rate_arcmin_per_s", 0.0) * 3600.0 * values.get("hours", 0.0)
    return Change(wear=gap * ARCMIN * 0.5 * geometry.nominal.lever * geometry.output_ratio / UM)


_OF_A_GAP = "both halves of the gap add {gap:.4g} arcmin of backlash"
_IN_BEARINGS = "every crank bearing has {bearing:.4g} um more clearance inside the contact"
COUNTERPARTS: Mapping[str, tuple[Callable[[Mapping[str, float], ContactGeometry], Change], str]] = {
    "differential_thermal_expansion": (
        _expansion,
        "discs and housing differ in temperature: the radius of the pin circle changes by {circle:+.4g} um against "
        "the discs",
    ),
    "process_mean_shift": (
        _shift,
        "every unit's backlash changes by {shift:+.4g} arcmin, and its overlap by as much the other way; what is "
        "solved under load keeps to the contact",
    ),
    "spread_inflation": (
        _inflation,
        "the backlash, and the overlap, scatters {growth:.4g} % more about its mean; what is solved under load keeps "
        "to the contact",
    ),
    "wear": (_wear, "flanks have lost {wear:.4g} um after the hours of the condition"),
    "lost_motion": (_gap, _OF_A_GAP),
    "bearing_clearance": (_gap, _OF_A_GAP),
}
"""The effects that have a counterpart in `rv_backlash`, too."""


def change_of(active: Active, geometry: ContactGeometry) -> Change:
    """What one effect changes; nothing where it has no counterpart."""
    counterpart = COUNTERPARTS.get(active.effect.name)
    return counterpart[0](active.values, geometry) if counterpart else Change()


def changes_of(effects: Iterable[Active], geometry: ContactGeometry) -> Change:
    """What all effects change."""
    return sum((change_of(effect, geometry) for effect in effects), Change())


def sentence(active: Active, geometry: ContactGeometry) -> str:
    """What one effect does here, empty where it does nothing."""
    change = change_of(active, geometry)
    if change == Change() and active.effect.name != "wear":  # which does nothing in a new unit
        return ""
    text = _IN_BEARINGS if change.bearing else COUNTERPARTS[active.effect.name][1]
    return text.format(
        circle=change.circle,
        bearing=change.bearing,
        wear=change.wear,
        gap=change.gap,
        shift=change.shift,
        growth=100.0 * change.growth,
    )


# Statistics over units whose backlash is shifted and scatters more than their contact says.
#
# b' = m + s + (1 + g)(b - m) of every unit (and position, for the root mean square), m the mean. What
# interferes is counted on y' of the same rule, y the signed backlash of the cycloid stage and m its
# mean over units and positions; a gap elsewhere is in s of the backlash, and moves no flank.


class ChangedMeasures(Measures):
    """Statistics by name as those of `plain`, with what effects change outside the contact."""

    def __init__(self, plain: Measures, change: Change) -> None:
        super().__init__(plain.turn, plain.involute, plain.conditions)
        self.plain, self.change = plain, change

    def _computed(self, name: str) -> Measure:
        return RULES[name.partition(" ")[0]](self, name)

    def _deviation(self, name: str) -> Measure:
        plain = self.plain[name]
        return replace(plain, statistic=_combine_statistics((plain.statistic, 1.0 + self.change.growth)))

    def _about_mean(self, name: str) -> Measure:
        plain, middle, growth = self.plain[name], self.plain[f"mean {name.partition(' ')[2]}"], self.change.growth
        parts = (plain.statistic, 1.0 + growth), (middle.statistic, -growth)
        return replace(plain, statistic=_combine_statistics(*parts, shift=self.change.effective))

    def _signed(self, name: str) -> Measure:
        """A statistic of y, in which flanks that interfere are below zero."""
        if self.change.shift == 0.0 and self.change.growth == 0.0:
            return self.plain[name]
        moved, growth = self._moved[name], self.change.growth

        def spread(weight: Array) -> Array:
            by_place = moved.spread(weight)
            return np.asarray((1.0 + growth) * by_place - growth * by_place.mean())

        return replace(moved, spread=spread, of=self.turn.held)

    @cached_property
    def _moved(self) -> Measures:
        """Statistics of the same units at y'."""
        tied, factor = self.turn.held or self.turn, 1.0 + self.change.growth
        play = tied.play.astype(np.float64)
        mean = float(play.mean())
        changed = mean + self.change.shift + factor * (play - mean)
        turn = replace(tied, play=changed.astype(np.float32))
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
        return replace(middle, statistic=_combine_statistics((within, 1.0), (moved, by_mean)))

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


def outputs_without_rule(measures: Mapping[str, str], outputs: Iterable[str], under_load: Collection[str]) -> list[str]:
    """Outputs of which nothing says what effects outside the contact do to them.

    Those under load keep to the contact: no shift of backlash is a shift of torque.
    """
    kinds = {output: measures.get(output, "").partition(" ")[0] for output in outputs if output not in under_load}
    return sorted(output for output, kind in kinds.items() if kind not in RULES)


def _combine_statistics(*parts: tuple[Statistic, float], shift: float = 0.0) -> Statistic:
    """The sum of statistics of the same units times factors; its error is at most that stated."""
    return Statistic(
        sum(factor * statistic.value for statistic, factor in parts) + shift,
        np.sum([factor * statistic.weight for statistic, factor in parts], axis=0),
        sum(factor * statistic.by_involute for statistic, factor in parts),
        sum(abs(factor) * statistic.error for statistic, factor in parts),
    )
