"""The mean unit of a population at every row: what a batch is compared with, unit by unit."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import make_interp_spline

from ...models.effects.compose import acting, added, changes_of
from ...models.inputs.distribution import Array
from ...models.measurable import MeasurableModel
from .data import GapData
from .law import on_scatter
from .library import Predict, carried
from .plan import GapPlan

POINTS = 9
"""Sizes of a change at which the mean of the population is taken; between them, a cubic."""


def of_mean_unit(plan: GapPlan, data: GapData, model: MeasurableModel) -> Predict:
    """The mean over the units of a population, each row with its own changes inside."""
    moving = [one for one in plan.active
              if not on_scatter(one.effect, one.values, data.readings, data.target)]  # fmt: skip
    actions = acting(moving, data.readings, data.target)
    always = changes_of(actions)
    by, bare = carried(plan.active, data.target), model.means()

    def predict(changes: Mapping[str, Array]) -> Mapping[str, Array]:
        rng = np.random.default_rng(plan.seed)
        found = _at(model, bare, both(always, changes), len(data))
        found = added(found, actions, bare, rng)
        return {o.name: found[o.name] + by for o in data.outputs}

    return predict


def _at(
    model: MeasurableModel, bare: Mapping[str, float], changes: Mapping[str, Array], count: int
) -> dict[str, Array]:
    """Means (count,) with changes (count,), those of several quantities added up."""
    found = {name: np.full(count, value) for name, value in bare.items()}
    for quantity, values in changes.items():
        at = np.unique(np.linspace(np.min(values), np.max(values), POINTS))
        means = [model.means({quantity: one}) for one in at]
        for name, value in bare.items():
            curve = np.array([mean[name] for mean in means]) - value
            degree = min(3, len(at) - 1)
            found[name] += make_interp_spline(at, curve, degree)(values) if degree else curve[0]
    return found


def both(one: Mapping[str, Array], other: Mapping[str, Array]) -> dict[str, Array]:
    """Changes inside of a model together."""
    names = dict.fromkeys([*one, *other])
    return {name: np.asarray(one.get(name, 0.0) + other.get(name, 0.0)) for name in names}
