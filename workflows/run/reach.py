"""Limits that no known design of a sampled problem keeps, reported before a run begins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...algorithms.exact.branch import Branch
from ...algorithms.exact.epsilon import integer_faults, scale_of
from ...algorithms.exact.solver import Exact, closed_form
from ...algorithms.run import Run
from ...algorithms.settings import AlgorithmSettings, Budget
from ...arrays import Array
from ...errors import Fault, raise_all
from ...problems.interfaces import Checks, Differentiable
from ...problems.limits import Limit
from ...problems.tolerance_problem import ToleranceProblem

ATTEMPTS = 3
"""Searches for the least value, each from the result of the last."""


def searchable(problem: ToleranceProblem, algorithm: AlgorithmSettings | None = None) -> None:
    """Raises InputError with every reason why a problem cannot be searched as it is set."""
    many = _too_many_choices(problem) if isinstance(algorithm, Exact) else []
    raise_all([*many, *(Checks.of(problem).search_faults() or unreachable(problem))])


def _too_many_choices(problem: ToleranceProblem) -> list[Fault]:
    """More sets of choices than `exact` solves one by one where there is no closed form."""
    faults = integer_faults(problem)
    return faults if faults and closed_form(problem) is None else []


def unreachable(problem: ToleranceProblem) -> list[Fault]:
    """A fault for each upper limit that is below the least value found, with the design.

    Proven limits are `problem.faults()`; here the least value is that of a search by gradients at
    the finest grades, which proves nothing but is rarely wrong by more than its sample. There is no
    search where one of the problem's own starts keeps all limits.
    """
    starts = Differentiable.of(problem).starts() if problem.declaration.sampled else np.empty((0, 0))
    if not len(starts) or _any_feasible(problem, starts):
        return []
    return [
        fault
        for limit in problem.limits
        if limit.name in problem.declaration.performance and np.isfinite(limit.high)
        if (fault := _fault(problem, limit)) is not None
    ]


def _any_feasible(problem: ToleranceProblem, starts: Array) -> bool:
    outputs = problem.outputs_of(starts, searching=True)
    return bool(np.any(np.all(problem.violations(starts, outputs) <= 0.0, axis=1)))


def _fault(problem: ToleranceProblem, limit: Limit) -> Fault | None:
    """The fault of one limit, None where it can be kept."""
    least, design = _least(problem, limit.name)
    if not least > limit.high:
        return None
    values = ", ".join(f"{v.name} {design[problem.names.index(v.name)]:.4g}" for v in problem.free)
    unit = f" {limit.unit}".rstrip()
    return Fault(
        f"limits.{limit.name}",
        f"at most {limit.high:g}{unit} was not reached by any design: the least value found is "
        f"{least:.4g}{unit}, at {values}; raise the limit or widen the ranges",
    )


def _least(problem: ToleranceProblem, name: str) -> tuple[float, Array]:
    """The least value of an output with interference and geometry held, and its full design."""
    held = {n: b for n, b in problem.settings.limits.items() if n not in problem.declaration.performance}
    alone = type(problem)(replace(problem.given, objectives=(name,), limits=held))
    run = Run(alone, Budget(), seed=0)
    branch = Branch(run, alone.xl.copy(), scale_of(alone))
    none = np.full(1, np.inf)
    columns = [alone.names.index(v.name) for v in alone.free]
    start = branch.smooth.scaled(Differentiable.of(alone).starts()[:1, columns])[0]
    for _ in range(ATTEMPTS):
        branch.minimise(0, start, none)
        if branch.f:
            start = branch.y[int(np.argmin([f[0] for f in branch.f]))]
    if not branch.f:
        return -np.inf, Differentiable.of(alone).starts()[0]
    best = alone.complete(branch.smooth.vectors(start[None, :]))
    return float(min(f[0] for f in branch.f)), best[0]
