"""Outputs of one design on a population, and their derivatives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import log

import numpy as np
from numpy.typing import NDArray

from ...models.rv_reducer.population.gradient import NAMES
from ...models.rv_reducer.population.measures import Measure, Measures
from ...models.rv_reducer.population.turn import Population, Turn
from .outputs import MEASURED
from .units import UnitModel

Array = NDArray[np.float64]
PART = {"backlash_max_arcmin": "max", "backlash_mean_arcmin": "mean"}
MEASURES = {
    **{name: f"quantile {PART[name]}" for name in MEASURED},
    **{f"{name}_mean": f"mean {PART[name]}" for name in MEASURED},
    **{f"{name}_std": f"deviation {PART[name]}" for name in MEASURED},
    "backlash_rms_arcmin": "rms",
    "yield_percent": "yield",
    "interference_probability": "interference",
}
"""The measure of each sampled output."""
SCALE = {"yield_percent": 100.0}
VARIABLE = {
    "stagger": "stagger_arcmin",
    "dr_rp": "dr_rp_mm",
    "dr_p": "dr_p_mm",
    "crank_phase": "crank_phase_mrad",
}
"""Variables of derivatives whose names do not end in `_um`."""
BY_GRADE = 0.5 * log(2.0)
"""Derivative of ln(phi_1) by the ISO grade."""


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """One design on one population."""

    turn: Turn
    measures: Measures

    @classmethod
    def of(cls, model: UnitModel, population: Population, row: Mapping[str, float]) -> Evaluation:
        """The evaluation of one row of variables by name."""
        design = model.design(row)
        turn = population.turn(design)
        return cls(turn, Measures(turn, model.involute(design.involute_grade), model.conditions))

    def value(self, name: str) -> float:
        """A sampled output."""
        return SCALE.get(name, 1.0) * self._measure(name).statistic.value

    def error(self, name: str) -> float:
        """Its standard error."""
        return SCALE.get(name, 1.0) * self._measure(name).statistic.error

    def gradient(self, name: str) -> dict[str, float]:
        """Derivatives of a sampled output by variable, in the units of both."""
        measure = self._measure(name)
        scale = SCALE.get(name, 1.0)
        slopes = scale * measure.slopes(self.turn)
        found = {
            VARIABLE.get(one, f"{one}_um"): float(slope)
            for one, slope in zip(NAMES, slopes, strict=True)
        }
        found["involute_grade"] = scale * BY_GRADE * measure.statistic.by_involute
        circle = self.turn.design.width("pin_circle_radius")
        if circle > 0.0:
            found["pin_circle_radius_um"] += scale * measure.statistic.by_zone / circle
        return found

    def share_of_turn(self) -> float:
        """Share of all positions of all units with interference."""
        return float(np.mean(self.turn.play < 0.0))

    def overlap(self, share: float) -> float:
        """Largest overlap over the turn [arcmin] that a `share` of the units stays below."""
        return float(np.quantile(np.maximum(-self.turn.play.min(axis=0), 0.0), share))

    def _measure(self, name: str) -> Measure:
        return self.measures[MEASURES[name]]
