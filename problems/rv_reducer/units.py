"""From the settings of the problem to the model of units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np

from ...declarations import Value, number
from ...models.inputs import Distribution
from ...models.rv_reducer.population.elastic_springs import Loading
from ...models.rv_reducer.population.measures import Conditions, Measures
from ...models.rv_reducer.population.turn import Population, Turn
from ...models.rv_reducer.population.unit_basis import UnitBasis, stem
from ...units import ARCMIN, MM
from ..settings import VariableSetting
from .changed_measures import ChangedMeasures
from .counterparts import Change


@dataclass(frozen=True, slots=True, eq=False)
class UnitModel(UnitBasis):
    """The properties common to all units, how units are drawn, and the conditions on them."""

    conditions: Conditions
    loading: Loading
    preload: float
    change: Change = field(default_factory=Change)

    @classmethod
    def of(
        cls, parameters: Mapping[str, Value], variables: Mapping[str, VariableSetting], coverage: float
    ) -> UnitModel:
        """The model of completed settings."""
        inputs: dict[str, Distribution] = {
            stem(name): setting.distribution for name, setting in variables.items() if setting.distribution
        }
        mids = {stem(name): setting.centre for name, setting in variables.items() if setting.centre is not None}
        conditions = Conditions(
            coverage,
            number(parameters["backlash_limit_arcmin"]),
            str(parameters["interference"]),
            number(parameters["overlap_arcmin"]),
        )
        rated = number(parameters["rated_torque_Nm"])
        loading = Loading(
            normal_stiffness=number(parameters["normal_stiffness_N_per_mm"]) / MM,
            series_stiffness=number(parameters["series_stiffness_Nm_per_arcmin"]) / ARCMIN,
            rated_torque=rated,
            te_torque=number(parameters["te_torque_Nm"]) or rated,
        )
        preload = 0.01 * number(parameters["preload_percent_of_rated"]) * rated
        basis = UnitBasis.from_parameters(parameters, inputs, mids)
        common = {field.name: getattr(basis, field.name) for field in fields(UnitBasis)}
        return cls(**common, conditions=conditions, loading=loading, preload=preload)

    def changed(self, change: Change) -> UnitModel:
        """The model with what effects change in it."""
        mid = dict(self.mid)
        for error, more in change.inside.items():
            mid[error] = mid.get(error, 0.0) + more
        return replace(self, mid=mid, change=change)

    def measures(self, turn: Turn) -> Measures:
        """Statistics of the units of a turn, with what effects change outside their contact."""
        statistics = Measures(turn, self.involute(turn.design.involute_grade), self.conditions)
        return ChangedMeasures(statistics, self.change) if self.change.outside else statistics

    def population(self, positions: int, units: int, seed: int, stream: int) -> Population:
        """A population drawn from `seed`; each `stream` is independent of the others."""
        rng = np.random.default_rng([seed, stream])
        return Population.draw(self.geometry, positions, units, rng, self.hierarchy)
