"""Which limits of a problem keep its promise."""

from __future__ import annotations

from ...problems.stack import Stack
from ...problems.tolerance_problem import ToleranceProblem


def promised_limits(problem: ToleranceProblem) -> set[str]:
    """Names of the limits that keep the promise of a problem, none where it promises nothing."""
    if not isinstance(problem, Stack) or problem.promises is None:
        return set()
    output = problem.promises.promise.output
    return {one.measured.name(output) for one in problem.promises.each}
