"""The cheapest allocation that keeps a promise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ...algorithms.exact.afresh import feasible_afresh
from ...algorithms.exact.bounds import row_limits
from ...algorithms.exact.branch import Branch
from ...algorithms.exact.choices import Optimum, least_cost
from ...algorithms.exact.epsilon import SETS, scale_of
from ...algorithms.exact.solver import Exact, closed_form
from ...algorithms.hybrid import Hybrid
from ...algorithms.run import Run
from ...algorithms.search import search
from ...algorithms.settings import Budget
from ...arrays import Array
from ...problems.forms import Form
from ...problems.limits import loosened
from ...problems.stack import Stack
from ...problems.tolerance_problem import ToleranceProblem

Solved: TypeAlias = tuple[Form, Optimum]
"""The form of a problem, and its least cost."""
EVALUATIONS = 600
"""Of a search among many choices of processes."""


@dataclass(frozen=True, slots=True)
class Least:
    """A full design (all variables,) and its cost; NaN where there is none."""

    cost: float
    design: Array

    @classmethod
    def none(cls, problem: ToleranceProblem) -> Least:
        """No design."""
        return cls(float("nan"), np.full(len(problem.variables), np.nan))


def cheapest(problem: ToleranceProblem, near: Array | None = None) -> Least:
    """The cheapest design of a problem whose only objective is the cost: exact where it can be.

    Many choices without a closed form are searched (an expected yield by sampled machines). A
    problem that is tested on units is solved from the design `near` (all variables,), at its
    integers.
    """
    if problem.declaration.sampled and near is not None:
        return _near(problem, near)
    solver, budget = (Hybrid(), Budget(evaluations=EVALUATIONS)) if _many(problem) else (Exact(), Budget())
    result = search(problem, solver, budget, problem.settings.seed)
    x = result.chosen if len(result.chosen) else result.x
    if not len(x):
        return Least.none(problem)
    designs = problem.complete(x)
    costs = problem.cost_of(designs)
    at = int(np.argmin(costs))
    return Least(float(costs[at]), designs[at])


def _many(problem: ToleranceProblem) -> bool:
    """Whether a problem has more choices of processes than are enumerated, and no closed form."""
    if not isinstance(problem, Stack):
        return False
    choices = float(np.prod([len(part.processes) for part in problem.definition.parts], dtype=float))
    return choices > SETS and closed_form(problem) is None


def _near(problem: ToleranceProblem, near: Array) -> Least:
    """By gradients from a design (all,), at its integers, tested on fresh units."""
    run = Run(problem, Budget(), problem.settings.seed)
    free = [problem.names.index(v.name) for v in problem.free]
    branch = Branch(run, np.clip(near[free], problem.xl, problem.xu), scale_of(problem))
    start = branch.smooth.scaled(near[None, free])[0]
    if branch.minimise(0, start, np.full(1, np.inf)) is None:
        return Least.none(problem)
    x = feasible_afresh(run, branch, branch.y[0], branch.f[0], search=True)
    if np.any(problem.tested(x)[1] > 0.0):
        return Least.none(problem)
    design = problem.complete(x)
    return Least(float(problem.cost_of(design)[0]), design[0])


def solved(problem: ToleranceProblem) -> Solved | None:
    """The form of a problem and its least cost with multipliers; None without a closed form."""
    form = closed_form(problem)
    if form is None:
        return None
    optimum = least_cost(form, loosened(row_limits(problem, form), 0.5)[None, :])
    return (form, optimum) if np.isfinite(optimum.cost[0]) else None
