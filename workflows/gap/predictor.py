"""The prediction of the model at the rows of the data, as a function of changes inside it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from scipy.interpolate import make_interp_spline

from ...arrays import Array
from ...models.effects.compose import acting, added, changes_of, with_zero
from ...models.effects.effect import Action
from ...models.measurable import NO_CHANGES, MeasurableModel
from .data import GapData
from .law import on_scatter
from .library import Predict, carried
from .plan import GapPlan

POINTS = 9
"""Sizes of a change at which the mean of a population is taken; between them, a cubic."""


def predictor(plan: GapPlan, data: GapData, model: MeasurableModel | None = None) -> Predict:
    """The predictor of the plan's model, or of another one, with its known effects and zeros."""
    model = model or plan.model
    if model is None:
        return OfTable(plan, data)
    return OfMeanUnit(plan, data, model) if model.population else OfRows(plan, data, model)


class OfTable:
    """The prediction that the table carries; nothing can change inside."""

    def __init__(self, plan: GapPlan, data: GapData) -> None:
        actions = acting(plan.active, data.measurements, data.target)
        rng = np.random.default_rng(plan.seed)
        self._outputs = added(with_zero(data.predicted, plan.zero), actions, {}, rng)

    def __call__(self, changes: Mapping[str, Array]) -> Mapping[str, Array]:
        return self._outputs


class _OfModel:
    """Prediction of a model with the plan's effects that do not change the scatter of units;
    pickled by its arguments.
    """

    means: Mapping[str, float] = MappingProxyType({})
    """The mean of each output of a population."""

    def __init__(self, plan: GapPlan, data: GapData, model: MeasurableModel) -> None:
        self._plan, self._data, self._model = plan, data, model
        measurements, target = data.measurements, data.target
        moving = [o for o in plan.active if not on_scatter(o.effect, o.values, measurements, target)]
        self._actions = acting(moving, measurements, target)

    def __reduce__(self) -> tuple[type[_OfModel], tuple[GapPlan, GapData, MeasurableModel]]:
        return type(self), (self._plan, self._data, self._model)

    def __call__(self, changes: Mapping[str, Array]) -> Mapping[str, Array]:
        rng = np.random.default_rng(self._plan.seed)
        whole = changes_of((*self._actions, Action(changes=changes)))
        return added(self._at(whole, rng), self._actions, self.means, rng)

    @abstractmethod
    def _at(self, changes: Mapping[str, Array], rng: np.random.Generator) -> Mapping[str, Array]:
        """Outputs (n,) of the model with changes inside."""


class OfRows(_OfModel):
    """Prediction row by row."""

    def _at(self, changes: Mapping[str, Array], rng: np.random.Generator) -> Mapping[str, Array]:
        outputs = self._model.predict(self._data.measurements.table, rng, changes or NO_CHANGES)
        return with_zero(outputs, self._plan.zero)


class OfMeanUnit(_OfModel):
    """The mean unit of a population, with changes inside by row: the reference of a batch's units."""

    def __init__(self, plan: GapPlan, data: GapData, model: MeasurableModel) -> None:
        super().__init__(plan, data, model)
        self.means = model.means()

    def _at(self, changes: Mapping[str, Array], rng: np.random.Generator) -> Mapping[str, Array]:
        """Means with changes; the changes of several quantities are added."""
        by = carried(self._plan.active, self._data.target)
        outputs = {name: np.full(len(self._data), value + by) for name, value in self.means.items()}
        for quantity, values in changes.items():
            at = np.unique(np.linspace(np.min(values), np.max(values), POINTS))
            means = [self._model.means({quantity: size}) for size in at]
            for name, value in self.means.items():
                curve = np.array([mean[name] for mean in means]) - value
                degree = min(3, len(at) - 1)
                outputs[name] += make_interp_spline(at, curve, degree)(values) if degree else curve[0]
        return outputs
