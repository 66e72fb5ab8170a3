"""Changes that effects make in the backlash of an allocation's units."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from ...models.effects.compose import Active
from ...models.propagation import ClippedSum, Estimate, Propagated, Propagation
from ...models.rv_reducer.backlash import BacklashModel
from ...models.rv_reducer.batch import opening
from ...units import ARCMIN, UM


@dataclass(frozen=True, slots=True)
class Change:
    """What effects change: `cycloid` is added to phi_2 (before interference is cut off) and
    `effective` to the backlash [rad]; its standard deviation grows by the fraction `growth`.
    """

    cycloid: float = 0.0
    effective: float = 0.0
    growth: float = 0.0

    def __add__(self, other: Change) -> Change:
        return Change(
            self.cycloid + other.cycloid,
            self.effective + other.effective,
            (1.0 + self.growth) * (1.0 + other.growth) - 1.0,
        )

    def opened(self, total: ClippedSum) -> ClippedSum:
        """The sum with the change of phi_2 in its first term."""
        return total if self.cycloid == 0.0 else total.shifted(self.cycloid)

    def propagate(self, method: Propagation, total: ClippedSum, coverage: float, limit: float) -> Propagated:
        """Statistics of the changed backlash; y becomes mean + shift + (1 + growth)(y - mean)."""
        plain = method.propagate(total, coverage, limit - self.effective)
        if self.growth == 0.0:
            return _moved(plain, self.effective, 1.0)
        factor, mean = 1.0 + self.growth, plain.mean.value
        # the changed value keeps the limit where the plain one keeps this, design by design
        kept = mean + (limit - self.effective - mean) / factor
        conforming = method.propagate(total.freed(-kept), coverage, 0.0).conforming
        return _moved(plain, self.effective, factor, conforming)


def _moved(plain: Propagated, shift: float, factor: float, conforming: Estimate | None = None) -> Propagated:
    mean = plain.mean.value
    quantile_error = factor * plain.quantile.error
    if factor != 1.0:
        quantile_error = quantile_error + (factor - 1.0) * plain.mean.error
    return Propagated(
        plain.geometric_mean + shift,
        factor * plain.geometric_std,
        Estimate(mean + shift, plain.mean.error),
        Estimate(factor * plain.std.value, factor * plain.std.error),
        Estimate(mean + shift + factor * (plain.quantile.value - mean), quantile_error),
        conforming or plain.conforming,
        plain.negative,
    )


def _expansion(values: Mapping[str, float], model: BacklashModel) -> Change:
    warmer = np.array(values.get("temperature_difference_K", 0.0))
    return Change(cycloid=float(opening(model, {"disc_temperature_K": warmer})))


def _shift(values: Mapping[str, float], model: BacklashModel) -> Change:
    return Change(effective=values.get("shift_arcmin", 0.0) * ARCMIN)


def _inflation(values: Mapping[str, float], model: BacklashModel) -> Change:
    return Change(growth=values.get("growth", 0.0))


def _gap(values: Mapping[str, float], model: BacklashModel) -> Change:
    """Both halves of a gap that is crossed when the torque changes its sign."""
    play = values.get("bearing_clearance_um", 0.0) * UM / model.geometry.centre_distance
    gap = 2.0 * values.get("half_width_arcmin", 0.0) * ARCMIN
    return Change(effective=gap + model.output_factor * play)


COUNTERPARTS: Mapping[str, tuple[Callable[[Mapping[str, float], BacklashModel], Change], str]] = {
    "differential_thermal_expansion": (
        _expansion,
        "the warmer disc fills the pin circle: phi_2 changes by {cycloid:+.4g} arcmin",
    ),
    "process_mean_shift": (_shift, "every unit's backlash changes by {effective:+.4g} arcmin"),
    "spread_inflation": (_inflation, "the backlash scatters {growth:.4g} % more about its mean"),
    "lost_motion": (_gap, "both halves of the gap add {effective:.4g} arcmin of backlash"),
    "bearing_clearance": (_gap, "the clearance adds {effective:.4g} arcmin of backlash"),
}


def change_of(active: Active, model: BacklashModel) -> Change:
    """What one effect changes; nothing where it has no counterpart."""
    counterpart = COUNTERPARTS.get(active.effect.name)
    return counterpart[0](active.values, model) if counterpart else Change()


def changes_of(effects: Iterable[Active], model: BacklashModel) -> Change:
    """What all effects change."""
    return sum((change_of(effect, model) for effect in effects), Change())


def sentence(active: Active, model: BacklashModel) -> str:
    """What one effect does here, empty where it does nothing."""
    change = change_of(active, model)
    if change == Change():
        return ""
    cycloid, effective = change.cycloid / ARCMIN, change.effective / ARCMIN
    text = COUNTERPARTS[active.effect.name][1]
    return text.format(cycloid=cycloid, effective=effective, growth=100.0 * change.growth)
