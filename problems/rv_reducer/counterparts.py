"""What effects do to units on their exact contact."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from ...models.effects.compose import Active
from ...models.rv_reducer.contact.geometry import ContactGeometry
from ...models.rv_reducer.cycloid import pin_circle_growth
from ...units import UM


@dataclass(frozen=True, slots=True)
class Change:
    """What effects change: `circle` [um] is the growth of the pin circle relative to the discs and
    `bearing` [um] a clearance of every crank bearing, both inside the contact. Outside of it every
    unit has `gap` [arcmin] of backlash more, which moves no flank, and units differ from those of
    the drawing: they are off by `shift` [arcmin] and scatter by the fraction `growth` more.
    """

    circle: float = 0.0
    bearing: float = 0.0
    gap: float = 0.0
    shift: float = 0.0
    growth: float = 0.0

    def __add__(self, other: Change) -> Change:
        return Change(
            self.circle + other.circle,
            self.bearing + other.bearing,
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
        return {"pin_circle_radius": self.circle, "crank_bearing": self.bearing}

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


_OF_A_GAP = "both halves of the gap add {gap:.4g} arcmin of backlash"
_IN_BEARINGS = "every crank bearing has {bearing:.4g} um more clearance inside the contact"
COUNTERPARTS: Mapping[str, tuple[Callable[[Mapping[str, float], ContactGeometry], Change], str]] = {
    "differential_thermal_expansion": (
        _expansion,
        "the warmer disc fills the pin circle: it grows by {circle:+.4g} um more than the discs",
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
    if change == Change():
        return ""
    text = _IN_BEARINGS if change.bearing else COUNTERPARTS[active.effect.name][1]
    return text.format(
        circle=change.circle, bearing=change.bearing, gap=change.gap, shift=change.shift, growth=100.0 * change.growth
    )
