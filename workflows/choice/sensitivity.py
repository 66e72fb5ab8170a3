"""How sure a choice is: the same rules with each cost curve 20 % lower and higher."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from ...arrays import Array
from .rule import COST, Points
from .rules import chosen

FACTORS = (0.8, 1.2)


def sensitivity(points: Points, costs: Mapping[str, Array]) -> pd.DataFrame:
    """What each rule chooses where one cost curve (n,) is multiplied by one of `FACTORS`.

    A row per rule, curve and factor: `point` is the row of the front chosen then, `same` whether
    it is the choice of the run, the objectives are those of that point, and `cost` and `cost_kept`
    what it and the choice of the run cost with the changed curve. Points are those of the front:
    nothing is searched again. Empty where the cost is no objective.
    """
    if COST not in points.names or points.cost is None:
        return pd.DataFrame()
    usual, rows = chosen(points), []
    for curve, part in costs.items():
        for factor in FACTORS:
            cost = points.cost + (factor - 1.0) * part
            choices = chosen(_with_cost(points, cost))
            rows += [
                {
                    "choice": rule,
                    "curve": curve,
                    "factor": factor,
                    "point": at,
                    "same": at == usual.get(rule),
                    "cost": cost[at],
                    "cost_kept": cost[usual[rule]] if rule in usual else np.nan,
                }
                | _objectives_except_cost(points, at)
                for rule, at in choices.items()
            ]
    table = pd.DataFrame(rows)
    return table.sort_values("choice", kind="stable", ignore_index=True) if rows else table


def _with_cost(points: Points, cost: Array) -> Points:
    values = points.objectives.copy()
    values[:, points.names.index(COST)] = cost
    return replace(points, objectives=values, cost=cost)


def _objectives_except_cost(points: Points, at: int) -> dict[str, float]:
    pairs = zip(points.names, points.objectives[at].tolist(), strict=True)
    return {name: value for name, value in pairs if name != COST}
