"""Which requirement drives which part, and what relaxing each would save."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from ...algorithms.exact.ascent import Ascent
from ...algorithms.exact.bounds import reason, restricted, row_limits
from ...algorithms.exact.choices import Optimum, least_cost
from ...algorithms.exact.combination import Combination, within
from ...algorithms.exact.pieces import convex_pieces
from ...algorithms.exact.programme import Programme
from ...arrays import Array
from ...problems.forms import Form
from ...problems.interfaces import Provable
from ...problems.limits import loosened
from ...problems.spread import largest_parts, spread_of
from ...problems.tolerance_problem import ToleranceProblem
from ...records import RunResult

LOOSER = 0.1
"""Fraction of its limit by which each requirement is relaxed."""
DRIVEN = 3
"""Parts named per requirement."""


def with_requirements(result: RunResult, problem: ToleranceProblem) -> RunResult:
    """The result with its tables of requirements, where the problem has several."""
    tables = requirements_of(problem, result.front)
    return result if tables is None else replace(result, requirements=tables[0], drivers=tables[1])


def requirements_of(problem: ToleranceProblem, front: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame] | None:
    """What each requirement costs at the knee of a front, or at its one point.

    None where a problem has one requirement, or no convex form. The multiplier is that of the least
    cost at the values of the point; the saving is proven to lie between that of an allocation that
    is known and that of the bound at the relaxed limit.
    """
    form = Provable.of(problem).form()
    if front.empty or form is None or len(set(form.outputs)) < 2 or reason(problem, form):
        return None
    at = int(np.argmax(front["knee"].to_numpy(dtype=bool) if "knee" in front else np.zeros(len(front), bool)))
    limits = _limits(problem, form, front.iloc[at])
    used = np.isfinite(limits)
    if not np.any(used):
        return None
    form, limits = convex_pieces(restricted(form, used)), limits[used]
    optimum = within(form, least_cost(form, loosened(limits)[None, :]), limits)
    if not np.isfinite(optimum.cost[0]):
        return None
    combination = Combination(form, tuple(optimum.chosen[0].tolist()))
    optimum = replace(optimum, cost=combination.cost(optimum.t))
    return _table(problem, limits, optimum, combination), _drivers(form, optimum, combination)


def _limits(problem: ToleranceProblem, form: Form, point: pd.Series) -> Array:
    """Limits (r,) of the form's requirements: the point's own objectives, and those of the run."""
    values = [float(point[name]) if name in problem.objectives else np.inf for name in form.outputs]
    return np.asarray(np.minimum(values, row_limits(problem, form)))


def _table(problem: ToleranceProblem, limits: Array, optimum: Optimum, combination: Combination) -> pd.DataFrame:
    """A row for each requirement: its limit, value, multiplier, and the saving at 10 % more."""
    form = combination.form
    values, multiplier = combination.values(optimum.t)[0], optimum.multiplier[0]
    units = {o.name: o.unit for o in problem.outputs}
    least, most = _savings(form, limits, optimum, combination)
    fractions = _fractions(optimum, combination)
    rows = []
    for at, name in enumerate(form.outputs):
        part, unit = form.labels[at] if form.labels else ("", "")
        unit = unit or ("" if np.isfinite(form.own_limits[at]) else units.get(name, ""))
        top = [int(j) for j in np.argsort(-fractions[at])[:DRIVEN] if fractions[at, j] > 0.0]
        names = [f"{form.features[j].variable} {100.0 * fractions[at, j]:.0f} %" for j in top]
        rows.append(
            {
                "requirement": name,
                "row": part or name,
                "unit": unit,
                "limit": limits[at],
                "value": values[at],
                "multiplier_cost_per_unit": multiplier[at],
                "relaxed_by_percent": 100.0 * LOOSER,
                "saves_at_least": least[at],
                "saves_at_most": most[at],
                "drives": ", ".join(names),
            }
        )
    return pd.DataFrame(rows)


def _savings(form: Form, limits: Array, optimum: Optimum, combination: Combination) -> tuple[Array, Array]:
    """What relaxing each limit alone saves at least and at most (r,): 0 where it does not bind.

    At least the saving with the same processes, solved again; at most that of the bound by the best
    multipliers, which holds for any choice of processes (`Ascent`).
    """
    most_parts = largest_parts(form) if form.quantiles else None
    least, most = np.zeros(len(limits)), np.zeros(len(limits))
    for at in np.flatnonzero(optimum.multiplier[0] > 0.0):
        relaxed = limits.copy()
        relaxed[at] += LOOSER * abs(limits[at])
        same = Programme(combination).least_cost(relaxed[None, :])
        dual = Ascent(form, relaxed, spread_of(form, combination.parts(same.t), most_parts))
        bound = dual.value(dual.multipliers(same.multiplier[0]))[0]
        least[at] = max(float(optimum.bound[0] - same.cost[0]), 0.0)
        most[at] = max(float(optimum.cost[0]) - bound, least[at])
    return least, most


def _fractions(optimum: Optimum, combination: Combination) -> Array:
    """Fraction (r, features) of each part in the value of a requirement: t dV/dt over their sum."""
    along = np.abs(combination.gradients(optimum.t)[0] * optimum.t[0])
    whole = along.sum(axis=1, keepdims=True)
    return np.asarray(np.divide(along, whole, out=np.zeros_like(along), where=whole > 0.0))


def _drivers(form: Form, optimum: Optimum, combination: Combination) -> pd.DataFrame:
    """By part, the fraction [%] of each requirement in what limits its tolerance.

    At the least cost -dC/dt is the sum of multiplier times dV/dt over the requirements.
    """
    push = optimum.multiplier[0][:, None] * combination.gradients(optimum.t)[0]
    whole = np.abs(push).sum(axis=0)
    percent = 100.0 * np.divide(push, whole, out=np.zeros_like(push), where=whole > 0.0)
    rows = []
    for j, feature in enumerate(form.features):
        first = int(np.argmax(np.abs(push[:, j])))
        row = {
            "part": feature.variable,
            "t": optimum.t[0, j],
            "driven_by": form.outputs[first] if whole[j] > 0.0 else "",
        }
        rows.append(row | _by_name(form, percent[:, j]))
    return pd.DataFrame(rows)


def _by_name(form: Form, percent: Array) -> dict[str, float]:
    """Fractions [%] by output; rows of one output add up."""
    percentages: dict[str, float] = {}
    for name, value in zip(form.outputs, percent.tolist(), strict=True):
        percentages[f"{name}_percent"] = percentages.get(f"{name}_percent", 0.0) + value
    return percentages
