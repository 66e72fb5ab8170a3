"""What the model predicts at the rows of the data, as a function of changes inside of it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...models.effects.compose import acting, added, changes_of, with_zero
from ...models.inputs.distribution import Array
from ...models.measurable import NO_CHANGES, MeasurableModel
from .data import GapData
from .library import Predict
from .mean_unit import both, of_mean_unit
from .plan import GapPlan


def predictor(plan: GapPlan, data: GapData, model: MeasurableModel | None = None) -> Predict:
    """The model of the plan (or another one) with the effects and zeros that it has already."""
    of = plan.model if model is None else model
    if of is None:
        return OfTable(plan, data)
    return OfMeanUnit(plan, data, of) if of.population else OfRows(plan, data, of)


class OfTable:
    """The prediction that the table carries; nothing can change inside."""

    def __init__(self, plan: GapPlan, data: GapData) -> None:
        actions = acting(plan.active, data.readings, data.target)
        rng = np.random.default_rng(plan.seed)
        self._outputs = added(with_zero(data.predicted, plan.zero), actions, {}, rng)

    def __call__(self, changes: Mapping[str, Array]) -> Mapping[str, Array]:
        return self._outputs


class _OfModel:
    """Of a model; pickled as what it was made of."""

    def __init__(self, plan: GapPlan, data: GapData, model: MeasurableModel) -> None:
        self._plan, self._data, self._model = plan, data, model

    def __reduce__(self) -> tuple[type[_OfModel], tuple[GapPlan, GapData, MeasurableModel]]:
        return type(self), (self._plan, self._data, self._model)


class OfRows(_OfModel):
    """Row by row."""

    def __init__(self, plan: GapPlan, data: GapData, model: MeasurableModel) -> None:
        super().__init__(plan, data, model)
        self._actions = acting(plan.active, data.readings, data.target)

    def __call__(self, changes: Mapping[str, Array]) -> Mapping[str, Array]:
        rng = np.random.default_rng(self._plan.seed)
        whole = both(changes_of(self._actions), changes)
        found = self._model.predict(self._data.readings.table, rng, whole or NO_CHANGES)
        return added(with_zero(found, self._plan.zero), self._actions, {}, rng)


class OfMeanUnit(_OfModel):
    """The mean unit of a population, each row with its own changes."""

    def __init__(self, plan: GapPlan, data: GapData, model: MeasurableModel) -> None:
        super().__init__(plan, data, model)
        self._predict = of_mean_unit(plan, data, model)

    def __call__(self, changes: Mapping[str, Array]) -> Mapping[str, Array]:
        return self._predict(changes)
