"""What a machine would cost otherwise: reducers alike everywhere, calibrated or not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from ...algorithms.exact.bounds import restricted
from ...algorithms.exact.choices import least_cost
from ...problems.tolerance_problem import ToleranceProblem

SAME = 1e-3
"""Difference [percent] that is none: bounds and points differ by less."""


def alternatives(problem: ToleranceProblem, front: pd.DataFrame) -> list[dict[str, Any]]:
    """The least cost of the point in the middle of the front by cost, and of the same with each of
    the problem's alternatives, at its own values of everything that is minimised or limited.

    Empty where a problem has none, or nothing of it is proven.
    """
    others = problem.alternatives()
    if front.empty or not others:
        return []
    order = front["cost"].astype(float).argsort(kind="stable")
    row = front.iloc[int(order.iloc[len(front) // 2])]
    own = _least(problem, problem, row)
    if own is None:
        return []
    found = [(label, _least(one, problem, row)) for label, one in others.items()]
    return [
        {"label": label, "cost": cost, "this": own, "more_percent": 100.0 * (cost / own - 1.0)}
        for label, cost in found
        if cost is not None
    ]


def sentences(found: list[dict[str, Any]]) -> tuple[str, ...]:
    """The same in words."""
    told = []
    for one in found:
        if abs(one["more_percent"]) < SAME:
            told.append(f"{one['label']}: as cheap, at equal R and equal other requirements")
            continue
        side = "more" if one["more_percent"] >= 0.0 else "less"
        told.append(
            f"{one['label']}: the least cost of the point in the middle of the front would "
            f"be {one['cost']:.4g} instead of {one['this']:.4g}, "
            f"{abs(one['more_percent']):.3g} % {side}, at equal R and equal other "
            "requirements"
        )
    return tuple(told)


def _least(one: ToleranceProblem, asked: ToleranceProblem, row: pd.Series[Any]) -> float | None:
    """Least cost of a problem at what is `asked` of the values of a row; None if not known."""
    form = one.form()
    if form is None:
        return None
    names = {*asked.objectives, *(limit.name for limit in asked.limits)}
    limits = np.array(
        [
            float(row[name]) if {name, form.stands.get(name, "")} & names else np.inf
            for name in form.outputs
        ]
    )
    used = np.isfinite(limits)
    if not np.any(used):
        return None
    found = least_cost(restricted(form, used), limits[None, used] * (1.0 + 1e-9))
    return float(found.cost[0]) if np.isfinite(found.cost[0]) else None
