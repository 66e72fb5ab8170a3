"""What the alternatives of a machine would cost: equal reducers everywhere, calibrated or not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from ...algorithms.exact.bounds import restricted
from ...algorithms.exact.choices import least_cost
from ...problems.interfaces import Comparison, Provable
from ...problems.tolerance_problem import ToleranceProblem
from .front import middle_point

SAME = 1e-3
"""Difference [percent] below which two costs count as equal: bounds and points differ by less."""


def alternatives(problem: ToleranceProblem, front: pd.DataFrame) -> list[dict[str, Any]]:
    """The least cost at the point in the middle of the front by cost, for the problem and for each
    of its alternatives, at the point's values of all objectives and limited outputs.

    Empty where a problem has no alternatives, or where its least cost is not proven.
    """
    others = Comparison.of(problem).alternatives()
    if front.empty or not others:
        return []
    row = middle_point(front)
    base_cost = _least(problem, problem, row)
    if base_cost is None:
        return []
    costs = [(label, _least(alternative, problem, row)) for label, alternative in others.items()]
    return [
        {"label": label, "cost": cost, "this": base_cost, "more_percent": 100.0 * (cost / base_cost - 1.0)}
        for label, cost in costs
        if cost is not None
    ]


def sentences(rows: list[dict[str, Any]]) -> tuple[str, ...]:
    """The alternatives in sentences."""
    messages = []
    for row in rows:
        if abs(row["more_percent"]) < SAME:
            messages.append(f"{row['label']}: costs the same at equal R and equal other requirements")
            continue
        side = "more" if row["more_percent"] >= 0.0 else "less"
        messages.append(
            f"{row['label']}: the least cost of the point in the middle of the front would be {row['cost']:.4g} "
            f"instead of {row['this']:.4g}, {abs(row['more_percent']):.3g} % {side}, at equal R and equal other "
            "requirements"
        )
    return tuple(messages)


def _least(problem: ToleranceProblem, asked: ToleranceProblem, row: pd.Series[Any]) -> float | None:
    """Least cost of a problem at a row's values of the goals and limits of `asked`, or None."""
    form = Provable.of(problem).form()
    if form is None:
        return None
    names = {*asked.objectives, *(limit.name for limit in asked.limits)}
    limits = np.array(
        [float(row[name]) if {name, form.stands.get(name, "")} & names else np.inf for name in form.outputs]
    )
    used = np.isfinite(limits)
    if not np.any(used):
        return None
    optimum = least_cost(restricted(form, used), limits[None, used] * (1.0 + 1e-9))
    return float(optimum.cost[0]) if np.isfinite(optimum.cost[0]) else None
