"""What the model predicts at the rows of the data, as a function of changes inside of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from ...models.effects.compose import acting, added, changes_of, with_zero
from ...models.effects.effect import Action
from ...models.inputs.distribution import Array
from ...models.measurable import NO_CHANGES, MeasurableModel
from .data import GapData
from .library import ON_SCATTER, Predict, carried
from .plan import GapPlan

UNITS = 32
"""Units drawn for each row to average what a change does to a population."""


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
        self._actions = acting(plan.active, data.readings, data.target)

    def __reduce__(self) -> tuple[type[_OfModel], tuple[GapPlan, GapData, MeasurableModel]]:
        return type(self), (self._plan, self._data, self._model)

    def _predicted(
        self, changes: Mapping[str, Array], actions: Sequence[Action], rng: np.random.Generator
    ) -> dict[str, Array]:
        found = self._model.predict(self._data.readings.table, rng, changes or NO_CHANGES)
        return added(with_zero(found, self._plan.zero), actions, self._model.means(), rng)


class OfRows(_OfModel):
    """Row by row."""

    def __call__(self, changes: Mapping[str, Array]) -> Mapping[str, Array]:
        whole = both(changes_of(self._actions), changes)
        return self._predicted(whole, self._actions, np.random.default_rng(self._plan.seed))


class OfMeanUnit(_OfModel):
    """The mean over the units of a population; what changes it is averaged over drawn units."""

    def __init__(self, plan: GapPlan, data: GapData, model: MeasurableModel) -> None:
        super().__init__(plan, data, model)
        moving = [one for one in plan.active if one.effect.name not in ON_SCATTER]
        self._actions = acting(moving, data.readings, data.target)
        by = carried(plan.active, data.target)
        self._means = {name: value + by for name, value in model.means().items()}

    def __call__(self, changes: Mapping[str, Array]) -> Mapping[str, Array]:
        data = self._data
        means = {o.name: np.full(len(data), self._means[o.name]) for o in data.outputs}
        if not changes and not self._actions:
            return means
        moved = self._mean(both(changes_of(self._actions), changes), self._actions)
        return {name: mean + moved[name] - self._bare[name] for name, mean in means.items()}

    @cached_property
    def _bare(self) -> dict[str, Array]:
        return self._mean(NO_CHANGES, ())

    def _mean(self, changes: Mapping[str, Array], actions: Sequence[Action]) -> dict[str, Array]:
        rngs = [np.random.default_rng([self._plan.seed, 7, number]) for number in range(UNITS)]
        runs = [self._predicted(changes, actions, rng) for rng in rngs]
        return {o.name: np.mean([run[o.name] for run in runs], axis=0) for o in self._data.outputs}


def both(one: Mapping[str, Array], other: Mapping[str, Array]) -> dict[str, Array]:
    """Changes inside of a model together."""
    names = dict.fromkeys([*one, *other])
    return {name: np.asarray(one.get(name, 0.0) + other.get(name, 0.0)) for name in names}
