"""Which limits of a problem keep its promise."""

from __future__ import annotations

from ...problems.stack import Stack
from ...problems.tolerance_problem import ToleranceProblem


def promised_limits(problem: ToleranceProblem) -> set[str]:
    """Names of the limits that keep the promise of a problem, none where it promises nothing."""
    if problem.promise is None:
        return set()
    if isinstance(problem, Stack) and problem.promises is not None:
        output = problem.promise.output
        return {requirement.measured.name(output) for requirement in problem.promises.requirement_promises}
    return {problem.promise.output}
