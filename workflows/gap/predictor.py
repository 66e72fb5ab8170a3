"""What the model predicts at the rows of the data, as a function of changes inside of it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import make_interp_spline

from ...models.effects.compose import acting, added, changes_of, with_zero
from ...models.inputs.distribution import Array
from ...models.measurable import NO_CHANGES, MeasurableModel
from .data import GapData
from .law import on_scatter
from .library import Predict, carried
from .plan import GapPlan

POINTS = 9
"""Sizes of a change at which the mean of a population is taken; between them, a cubic."""


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
    """The mean unit of a population, each row with its own changes inside: what a batch is compared
    with, unit by unit.
    """

    def __init__(self, plan: GapPlan, data: GapData, model: MeasurableModel) -> None:
        super().__init__(plan, data, model)
        readings, target = data.readings, data.target
        moving = [
            one for one in plan.active if not on_scatter(one.effect, one.values, readings, target)
        ]
        self._actions = acting(moving, readings, target)
        self._by, self._bare = carried(plan.active, data.target), model.means()

    def __call__(self, changes: Mapping[str, Array]) -> Mapping[str, Array]:
        rng = np.random.default_rng(self._plan.seed)
        found = self._at(both(changes_of(self._actions), changes))
        found = added(found, self._actions, self._bare, rng)
        return {o.name: found[o.name] + self._by for o in self._data.outputs}

    def _at(self, changes: Mapping[str, Array]) -> dict[str, Array]:
        """Means with changes, those of several quantities added up."""
        found = {name: np.full(len(self._data), value) for name, value in self._bare.items()}
        for quantity, values in changes.items():
            at = np.unique(np.linspace(np.min(values), np.max(values), POINTS))
            means = [self._model.means({quantity: one}) for one in at]
            for name, value in self._bare.items():
                curve = np.array([mean[name] for mean in means]) - value
                degree = min(3, len(at) - 1)
                found[name] += make_interp_spline(at, curve, degree)(values) if degree else curve[0]
        return found


def both(one: Mapping[str, Array], other: Mapping[str, Array]) -> dict[str, Array]:
    """Changes inside of a model together."""
    names = dict.fromkeys([*one, *other])
    return {name: np.asarray(one.get(name, 0.0) + other.get(name, 0.0)) for name in names}
