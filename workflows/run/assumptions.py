"""What the assumptions of a run cost: its least cost with one of them changed at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from ...algorithms.exact.branch import NEARLY, Branch
from ...algorithms.run import Progress, Run
from ...algorithms.settings import Budget
from ...arrays import Array
from ...problems.designs import designs_of
from ...problems.interfaces import Comparison, Variant
from ...problems.tolerance_problem import ToleranceProblem
from ...records import RunResult
from .units import NEAR, shown_point

INFEASIBLE = "no allocation found that keeps the limits at this grade"
RIGID = "backlash_"
"""Prefix of the outputs that are searched within a fraction of a second."""


def with_assumptions(
    result: RunResult,
    problem: ToleranceProblem,
    history: Sequence[Progress],
    progress: Callable[[Progress], None] | None,
) -> RunResult:
    """The result with the table of its shown point; `progress` continues `history`."""
    chosen = shown_point(result.front, Comparison.of(problem))
    if chosen is None:
        return result

    def phase(fraction: float) -> None:
        if progress is not None and history:
            progress(replace(history[-1], phase="what assumptions cost", share=fraction, remaining=None))

    point = result.front.iloc[[chosen[0]]]
    level = _aim(point, problem)
    ends = [np.array([result.summary[end][name] for name in problem.objectives]) for end in ("ideal", "nadir")]
    unit = np.maximum(ends[1] - ends[0], 1e-12)
    more = np.zeros(len(unit))
    if level is not None and level[0] in problem.objectives:
        more[problem.objectives.index(level[0])] = level[1] - float(point[level[0]].iloc[0])
    table = assumptions_cost(problem, designs_of(problem, point)[0], unit, more, phase)
    if table is None:
        return result
    summary = {**result.summary, "assumptions_at": _held_outputs(point, problem, level)}
    return replace(result, assumptions_cost=table, summary=summary)


def _aim(point: pd.DataFrame, problem: ToleranceProblem) -> tuple[str, float] | None:
    """The problem's limit where the point is near to it: the level of all costs."""
    limit = Comparison.of(problem).shown_limit()
    if limit is None or limit[0] not in point:
        return None
    return limit if abs(float(point[limit[0]].iloc[0]) / limit[1] - 1.0) <= NEAR else None


def _held_outputs(point: pd.DataFrame, problem: ToleranceProblem, level: tuple[str, float] | None) -> dict[str, float]:
    """The outputs that are held, with their values as they are reported."""
    held = [name for name in problem.objectives if name != "cost"]
    outputs = {name: float(point[name].iloc[0]) for name in held}
    if not held:
        outputs = {
            limit.name: problem.settings.limits[limit.name].high
            for limit in problem.limits
            if limit.name.startswith(RIGID)
        }
    return {name: level[1] if level and level[0] == name and held else value for name, value in outputs.items()}


def assumptions_cost(
    problem: ToleranceProblem,
    design: Array,
    unit: Array,
    more: Array,
    phase: Callable[[float], None] = lambda fraction: None,
) -> pd.DataFrame | None:
    """Least cost at the other objective's level of a full design (all variables,), by assumption.

    The first row is the problem as it is. All are solved on the sample of the search, from the
    design, at its integers; `unit` (m,) is the scale of the objectives, `more` (m,) is what is
    added to the levels of the design. `phase` is called with the fraction that is done. None where
    these costs are not defined: another problem than cost against backlash, least cost without a
    limit on backlash, or no allocation even without a change.
    """
    if not _applicable(problem):
        return None
    variants = Comparison.of(problem).variants()
    rows: list[dict[str, Any]] = []
    for row in _rows(problem, variants, design, (unit, more)):
        rows.append(row)
        phase(len(rows) / len(variants))
        if np.isnan(float(rows[0]["cost"])):
            return None
    return pd.DataFrame(rows) if len(rows) > 1 else None


def _applicable(problem: ToleranceProblem) -> bool:
    """Whether the run asks for cost against backlash, or for least cost at a backlash."""
    others = [name for name in problem.objectives if name != "cost"]
    if len(problem.objectives) != len(others) + 1 or not problem.declaration.sampled:
        return False
    if others:
        return len(others) == 1 and others[0].startswith(RIGID)
    return any(limit.name.startswith(RIGID) for limit in problem.limits)


def _rows(
    problem: ToleranceProblem, variants: tuple[Variant, ...], design: Array, scale: tuple[Array, Array]
) -> Iterator[dict[str, Any]]:
    free = [problem.names.index(v.name) for v in problem.free]
    x = np.clip(design[free], problem.xl, problem.xu)
    limit: Array | None = None
    base = np.nan
    for variant in variants:
        branch = Branch(Run(variant.problem, Budget(), seed=0), x, scale[0])
        if limit is None:
            limit = _level(branch, x) + scale[1]
        cost = _least(branch, x, limit)
        base = cost if np.isnan(base) else base
        yield {
            "assumption": variant.assumption,
            "value": variant.value,
            "cost": cost,
            "change_percent": 100.0 * (cost / base - 1.0),
            "remark": INFEASIBLE if np.isnan(cost) else "",
        }


def _level(branch: Branch, x: Array) -> Array:
    """The level (m,) of the objectives but the cost, at a search vector on the search's sample."""
    limit = branch.smooth.values(branch.smooth.scaled(x[None, :])[0])[0].copy()
    limit[branch.smooth.run.problem.objectives.index("cost")] = np.inf
    return limit


def _least(branch: Branch, x: Array, limit: Array) -> float:
    """Least cost within the limits, begun at `x` or else at the problem's own starts; or NaN."""
    run = branch.smooth.run
    cost = run.problem.objectives.index("cost")
    scaled = branch.smooth.scaled(x[None, :])[0]
    least = _least_value(branch, cost, scaled, limit)
    if not np.isnan(least):
        return least
    starts = (_least_value(branch, cost, start, limit) for start in branch.starts(run))
    return next((value for value in starts if not np.isnan(value)), np.nan)


def _least_value(branch: Branch, cost: int, start: Array, limit: Array) -> float:
    values = branch.minimise(cost, start, limit)
    if values is None or np.any(values > limit + NEARLY * branch.unit):
        return np.nan
    return float(values[cost])
