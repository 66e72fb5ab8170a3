"""The front before and after: what the effects in the model do to the allocation."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ...problems.designs import designs_of
from ...problems.interfaces import Accuracy, WithEffects
from ...problems.tolerance_problem import ToleranceProblem
from .plan import RunPlan
from .references import SideSearch

LABEL = "without effects"
LEVELS = (0.25, 0.5, 0.75)
"""Fractions of the range of the second objective that both fronts reach."""


def side_search(plan: RunPlan) -> tuple[SideSearch, ...]:
    """The same search in the model without its effects, where at least one changes the model."""
    if not any(WithEffects.of(plan.problem).counterparts()):
        return ()
    before = WithEffects.of(plan.problem).without_effects()
    return (SideSearch(LABEL, before, plan.algorithm, plan.budget, plan.seed, False, plan.engine, apart=True),)


def moved(problem: ToleranceProblem, before: pd.DataFrame, after: pd.DataFrame) -> pd.DataFrame:
    """How the allocation moves: pairs of points of both fronts, cheapest at the same level.

    One pair per level of the second objective (one pair where there is a single objective): the
    point `before`, the same design with the effects in the model (`kept`), and the point `after`.
    Empty where a front is empty, where there are more objectives, or where the fronts have no level
    in common.
    """
    names = list(problem.objectives)
    if before.empty or after.empty or len(names) > 2:
        return pd.DataFrame()
    rows = []
    for level in _levels(before, after, names):
        old, new = (_cheapest(front, names, level) for front in (before, after))
        unchanged = Accuracy.of(problem).reported().frame(designs_of(problem, old)).reindex(columns=before.columns)
        for label, row in (("before", old), ("kept", unchanged), ("after", new)):
            rows.append(row.assign(level=level, allocation=label))
    if not rows:
        return pd.DataFrame()
    free = [variable.name for variable in problem.free]
    return pd.concat(rows, ignore_index=True)[["level", "allocation", *names, *free]]


def _levels(before: pd.DataFrame, after: pd.DataFrame, names: list[str]) -> list[float]:
    if len(names) == 1:
        return [float("nan")]
    ranges = [(front[names[1]].min(), front[names[1]].max()) for front in (before, after)]
    low, high = max(bounds[0] for bounds in ranges), min(bounds[1] for bounds in ranges)
    return [low + fraction * (high - low) for fraction in LEVELS] if low < high else []


def _cheapest(front: pd.DataFrame, names: list[str], level: float) -> pd.DataFrame:
    """The point (one row) with the least first objective that keeps the level of the second."""
    within = front if np.isnan(level) else front[front[names[1]] <= level]
    return within.sort_values(names, kind="stable").head(1)


def summary(problem: ToleranceProblem) -> dict[str, object]:
    """The active effects as they stand in `summary.json`; empty where there are none."""
    pairs = zip(problem.settings.effects, WithEffects.of(problem).counterparts(), strict=True)
    rows = [
        {
            "name": active.effect.name,
            "family": active.effect.family,
            "parameters": dict(active.values),
            "counterpart": counterpart or None,
        }
        for active, counterpart in pairs
    ]
    return {"effects": rows} if rows else {}
