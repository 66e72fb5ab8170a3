"""Quantiles of the units of a batch: measured, and of the model before and after correction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from ...arrays import Array
from ...models.effects.compose import Active, predicted
from ...models.measurable import MeasurableModel
from .correct import zeros_with
from .data import GapData
from .plan import GapPlan
from .result import Ending

COLUMNS = ("output", "share", "measured", "before", "after")
DRAWN = 20_000
"""Least number of units drawn from a model."""
MOST = 400
"""Largest number of quantiles of a distribution."""


def spread_of_units(data: GapData, end: Ending) -> pd.DataFrame:
    """Quantiles by output at fractions of the units; empty where the model has no population.

    Those before are of the null model, without the effect on the scatter that the final setup
    carries; those after are of the corrected configuration, with its zeros and in its order.
    """
    plan = end.analysis.initial_null_model.setup.plan
    if plan.model is None or not data.target.population:
        return pd.DataFrame({name: [] for name in COLUMNS})
    scatter = [effect.active for effect in end.analysis.scatter[:1]]
    before = _drawn(plan, data, plan.model, plan.active, plan.zero)
    model = plan.rebuild(end.model.free()) if plan.rebuild and end.model.free() else plan.model
    after = _drawn(plan, data, model, (*scatter, *plan.active, *end.model.active), zeros_with(plan, end.model))
    count = min(MOST, len(data))
    fractions = (np.arange(count) + 0.5) / count
    sides = {"measured": data.measured, "before": before, "after": after}
    parts = [
        pd.DataFrame(
            {"output": output.name, "share": fractions}
            | {side: np.quantile(values[output.name], fractions) for side, values in sides.items()}
        )
        for output in data.outputs
    ]
    return pd.concat(parts, ignore_index=True)


def _drawn(
    plan: GapPlan, data: GapData, model: MeasurableModel, effects: Sequence[Active], zero: Mapping[str, float]
) -> dict[str, Array]:
    """Units (m,) drawn at the inputs of the data, equally many at each."""
    table = data.measurements.table
    runs = [
        predicted(model, plan.model_name, table, effects, np.random.default_rng([plan.seed, 9, number]), zero)
        for number in range(-(-DRAWN // len(data)))
    ]
    return {output.name: np.concatenate([run[output.name] for run in runs]) for output in data.outputs}
