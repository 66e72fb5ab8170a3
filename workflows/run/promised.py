"""The promise of a run and what is known of measured parts, as parts of its result."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from ...arrays import Array
from ...problems.designs import designs_of
from ...problems.interfaces import Checks
from ...problems.tolerance_problem import ToleranceProblem
from ...records import RunResult
from ..promise.limits import promised_limits
from .choices import chosen_point


def with_capability(result: RunResult, problem: ToleranceProblem) -> RunResult:
    """The result with what is known of measured parts, where there are some."""
    if not Checks.of(problem).samples():
        return result
    from ..promise.capability import capability_table

    return replace(result, capability=capability_table(problem))


def _rounded(result: RunResult, problem: ToleranceProblem, point: int) -> Array | None:
    """The full design (all variables,) of a point with the values of its drawing, if it has one."""
    allocation = result.allocation
    if allocation is None or result.front.empty or point not in set(allocation["point"]):
        return None
    row, first = result.front.iloc[[point]].copy(), allocation[allocation["point"] == point].drop_duplicates("variable")
    for name, value in zip(first["variable"], first["rounded"], strict=True):
        if name in problem.names and pd.notna(value):
            row[name] = value  # a number, or the name of a process or grade
    return np.array(designs_of(problem, row)[0])


def with_promise(result: RunResult, problem: ToleranceProblem) -> RunResult:
    """The result with its promise at the knee or at the only point, where a promise is made."""
    if not promised_limits(problem):
        return result
    from ..promise.outcome import promise_outcome  # its statistics take long to import

    point = chosen_point(result)
    outcome = promise_outcome(problem, result.front, point, _rounded(result, problem, point))
    if outcome is None:
        return result
    answers = dict(result.answers) | {"promise": outcome.sentence}
    summary = dict(result.summary) | {"promise": outcome.summary, "answers": answers}
    return replace(
        result,
        summary=summary,
        promise=outcome.costs if len(outcome.costs) else None,
        next_parts=outcome.next_parts if len(outcome.next_parts) else None,
    )
