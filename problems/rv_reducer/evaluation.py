"""Outputs of one design on a population, and their derivatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import log
from types import MappingProxyType

from ...arrays import Array
from ...models.rv_reducer.population.elastic import Elastic, elastic
from ...models.rv_reducer.population.gradient import NAMES
from ...models.rv_reducer.population.measures import Measures
from ...models.rv_reducer.population.scaled import Scaled
from ...models.rv_reducer.population.statistics import (
    NO_STAGE,
    Statistic,
    deviation,
    mean,
    ordered_quantile,
    quantile,
    share_above,
)
from ...models.rv_reducer.population.table import Table
from ...models.rv_reducer.population.turn import Population, Turn
from .outputs import MEASURED
from .units import UnitModel

PART = {"backlash_max_arcmin": "max", "backlash_mean_arcmin": "mean"}
MEASURES = {
    **{name: f"quantile {PART[name]}" for name in MEASURED},
    **{f"{name}_mean": f"mean {PART[name]}" for name in MEASURED},
    **{f"{name}_std": f"deviation {PART[name]}" for name in MEASURED},
    "backlash_rms_arcmin": "rms",
    "yield_percent": "yield",
    "interference_probability": "interference",
    "interference_share_of_turn": "interference share_of_turn",
    "overlap_p95_arcmin": "overlap",
}
"""The measure of each sampled output."""
SCALE = {"yield_percent": 100.0}
VARIABLE = {"stagger": "stagger_arcmin", "dr_rp": "dr_rp_mm", "dr_p": "dr_p_mm", "crank_phase": "crank_phase_mrad"}
"""Variables of derivatives whose names do not end in `_um`."""
BY_GRADE = 0.5 * log(2.0)
"""Derivative of ln(phi_1) by the ISO grade."""
LOADED = {
    "lost_motion_arcmin": "lost_motion",
    "transmission_error_arcsec": "transmission_error",
    "preload_torque_Nm": "preload_torque",
    "preload_torque_Nm_max": "preload_torque_max",
    "peak_pin_force_N": "peak_pin_force",
}
"""The elastic output that each output is a statistic of."""


def part_of(name: str) -> tuple[str, str]:
    """An output under load, and which statistic of it is meant: quantile, mean or std."""
    for part in ("mean", "std"):
        if name.endswith(f"_{part}") and name.removesuffix(f"_{part}") in LOADED:
            return name.removesuffix(f"_{part}"), part
    return name, "quantile"


def is_unit_statistic(name: str) -> bool:
    """Whether an output is a statistic over units."""
    return name in MEASURES or part_of(name)[0] in LOADED


@dataclass(frozen=True, eq=False)
class Populations:
    """The populations of a design: rigid units, units under load, and units for transmission error.

    Each is given as its numbers of positions and units, and drawn when it is first asked for.
    """

    draw: Callable[[int, int], Population]
    sizes: tuple[tuple[int, int], tuple[int, int], tuple[int, int]]

    @cached_property
    def rigid(self) -> Population:
        """Rigid units."""
        return self.draw(*self.sizes[0])

    @cached_property
    def loaded(self) -> Population:
        """Units under load."""
        return self.draw(*self.sizes[1])

    @cached_property
    def turning(self) -> Population:
        """Units whose transmission error is computed."""
        return self.draw(*self.sizes[2])


class Evaluation:
    """One design on populations; each statistic is computed when it is first asked for.

    `means` [um] are the offsets of the means of errors from their mid-limits, by name.
    """

    def __init__(
        self,
        model: UnitModel,
        drawn: Populations,
        row: Mapping[str, float],
        means: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        self.model, self.drawn, self.means = model, drawn, means
        self.design = model.design(row, means)
        self.involute = model.involute(self.design.involute_grade)
        self._elastic: dict[bool, Elastic] = {}
        self._statistics: dict[str, Statistic] = {}

    @cached_property
    def turn(self) -> Turn:
        """Rigid units over the turn."""
        return self.drawn.rigid.turn(self.design)

    @cached_property
    def measures(self) -> Measures:
        """Statistics of rigid units."""
        return self.model.measures(self.turn)

    def value(self, name: str) -> float:
        """A sampled output."""
        return SCALE.get(name, 1.0) * self._statistic(name).value

    def error(self, name: str) -> float:
        """Its standard error."""
        return SCALE.get(name, 1.0) * self._statistic(name).error

    def gradient(self, name: str) -> dict[str, float]:
        """Derivatives of a sampled output by variable, in the units of both."""
        statistic, scale = self._statistic(name), SCALE.get(name, 1.0)
        slopes = self._slopes(name)
        slopes["involute_grade"] = scale * BY_GRADE * statistic.by_involute
        circle = self.design.width("pin_circle_radius")
        if circle > 0.0:
            slopes["pin_circle_radius_um"] += scale * statistic.by_zone / circle
        return slopes

    def by_mean(self, name: str) -> dict[str, float]:
        """Derivatives of a sampled output by the means of errors, by variable.

        A mean moves every unit as its zone does one whose standardised error is 1; that of the
        position of the pins turns the unit, and moves nothing.
        """
        if not any(self.means.values()):
            return {}
        slopes, moving = self.slopes_of_means(name), self.means.keys() - {"pin_position"}
        return {f"{error}_um": slopes[f"{error}_um"] for error in moving}

    def slopes_of_means(self, name: str) -> dict[str, float]:
        """The same by the mean of every error, by variable."""
        return self._slopes(name, alike=True)

    def _slopes(self, name: str, alike: bool = False) -> dict[str, float]:
        """Derivatives of a sampled output over its units, by variable."""
        statistic, scale = self._statistic(name), SCALE.get(name, 1.0)
        if self._under_load(name):
            slopes = self._pulled_back(name, statistic, alike)
        else:
            measure, drawn = self.measures[MEASURES[name]], self.drawn.rigid
            slopes = measure.slopes(self.turn, drawn.alike() if alike else drawn.slopes)
        return {
            VARIABLE.get(error, f"{error}_um"): float(slope) for error, slope in zip(NAMES, scale * slopes, strict=True)
        }

    # ---------------------------------------------------------------- statistics

    def _under_load(self, name: str) -> bool:
        preload = self.model.conditions.interference == "preload"
        return name not in MEASURES or (preload and name == "interference_probability")

    def _statistic(self, name: str) -> Statistic:
        if name not in self._statistics:
            under_load = self._under_load(name)
            self._statistics[name] = self._loaded(name) if under_load else self.measures[MEASURES[name]].statistic
        return self._statistics[name]

    def _loaded(self, name: str) -> Statistic:
        """A statistic of units under load."""
        if name == "interference_probability":
            values = self._units_under_load("preload_torque_Nm").values["preload_torque"]
            return share_above(values, self.model.preload)
        output, part = part_of(name)
        values = self._units_under_load(output).values[LOADED[output]]
        coverage, geared = self.model.conditions.coverage, output == "lost_motion_arcmin"
        if part == "quantile":
            return quantile(values, self.involute, coverage) if geared else ordered_quantile(values, coverage)
        return (mean if part == "mean" else deviation)(values, self.involute if geared else NO_STAGE)

    def _units_under_load(self, output: str) -> Elastic:
        turning = output == "transmission_error_arcsec"
        if turning not in self._elastic:
            drawn = self.drawn.turning if turning else self.drawn.loaded
            table = Table.of(drawn.lattice, self.design.dr_rp, self.design.dr_p)
            units = Scaled.of(drawn.lattice.geometry, drawn.sample, self.design)
            names = [name for name in LOADED.values() if (name == "transmission_error") == turning]
            self._elastic[turning] = elastic(drawn.lattice, table, units, self.model.loading, drawn.engine, names)
        return self._elastic[turning]

    def _pulled_back(self, name: str, statistic: Statistic, alike: bool) -> Array:
        output = "preload_torque_Nm" if name == "interference_probability" else part_of(name)[0]
        loaded = self._units_under_load(output)
        turning = output == "transmission_error_arcsec"
        drawn = self.drawn.turning if turning else self.drawn.loaded
        errors = drawn.alike() if alike else drawn.slopes
        return loaded.pull_back(errors, {LOADED[output]: statistic.weight})
