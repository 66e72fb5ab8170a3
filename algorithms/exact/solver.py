"""`exact`: the front in closed form where the problem has one, else by epsilon-constraints."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar

import numpy as np

from ...arrays import Array, Flags
from ...counts import POINTS
from ...problems.forms import Form
from ...problems.interfaces import Provable
from ...problems.tolerance_problem import ToleranceProblem
from ..run import Run
from ..settings import Solver
from .bounds import reason, restricted, row_limits, upper_limit
from .choices import Optimum, Watch, least_cost, tightest_ways, unwatched
from .corrected import corrected_vectors, is_corrected
from .designs import search_vector, search_vectors
from .epsilon import epsilon_front
from .front import COARSE, front, tightest
from .pieces import convex_pieces

TIGHTER, TIGHTER_SHARE = 1e-12, 2e-10
"""Relative tightening of a limit, so that rounding does not break it; that of a fraction of units,
whose rounding is magnified by an edge far out in the tail."""
POINTS_BY_DEFAULT = 1000
"""Points of an exact front."""
FEW, CORRECTED = 40, 200
"""Points of a front that is corrected by the full model, by default and at most."""
CORRECTIONS, FURTHER = 6, 1.0 + 1e-3
"""Times a limit is moved by what a form understates, and how much further than that."""
EARLY = 0.9
"""Fraction of the work that a closed form takes."""
SOME = 3
"""Points of a front that are tested: if any breaks limits in the full model, the limits are moved."""


@dataclass(frozen=True, slots=True)
class Exact(Solver):
    """Exact front: Lagrange (Karush, Kuhn & Tucker) and branch and bound, else SLSQP."""

    many_objectives: ClassVar[bool] = True
    one_objective: ClassVar[bool] = True
    points: int = field(default=POINTS_BY_DEFAULT, metadata={"low": 2, "need": POINTS})

    def solve(self, run: Run) -> None:
        form = closed_form(run.problem)
        if form is None:
            epsilon_front(run, self.points)
            return
        run.phase("closed form", 0.0)
        remaining = run.evaluations_left
        points = self.points if remaining is None else max(2, min(self.points, remaining))
        if is_corrected(form):
            few = FEW if self.points == POINTS_BY_DEFAULT else CORRECTED
            x = corrected_vectors(run, form, min(points, few))
            if len(x):
                run.choose(x)
                run.evaluate(x)
            return
        x = exact_vectors(run.problem, form, points, partial(_solved, run, form))
        if not len(x):
            return
        if form.stands:  # a report computes the represented outputs more accurately
            run.choose(x)
        early = run.evaluations > 0
        run.phase("points of the closed form", EARLY)
        _, violations = run.evaluate(x)
        if early and not form.stands and np.all(violations <= 0.0):
            run.choose(x)  # rather than points of a coarse front
        if form.tested and not np.all(violations <= 0.0):
            epsilon_front(run, self.points)


def _solved(run: Run, form: Form, optimum: Optimum, share: float) -> None:
    """Report a point that is solved; those of a coarse front are evaluated, so that it has points
    from the start, unless evaluations are counted.
    """
    run.phase("closed form", EARLY * share)
    if run.evaluations_left is None and run.evaluations < COARSE and len(optimum.cost) == 1 and run.problem.n_obj > 1:
        x = search_vectors(run.problem, form, optimum)
        if len(x):
            run.evaluate(x)
            return
    run.pulse()


def closed_form(problem: ToleranceProblem) -> Form | None:
    """The form, restricted to the requirements of the problem; None where it omits any of them."""
    form = Provable.of(problem).form()
    if form is None or form.relaxed or reason(problem, form):
        return None
    asked = {*problem.objectives, *(limit.name for limit in problem.limits)}
    used = np.array([not asked.isdisjoint(form.requesting_outputs(name)) for name in form.outputs])
    if not np.any(used):
        return None
    return convex_pieces(restricted(form, used))


def exact_vectors(problem: ToleranceProblem, form: Form, points: int, watch: Watch = unwatched) -> Array:
    """Search vectors (k, variables) of the exact front, or of the one least cost."""
    upper = _solved_limits(problem, form)
    real = np.isfinite(upper)
    tighter = np.where(np.isfinite(form.own_limits), TIGHTER_SHARE, TIGHTER)
    least, slack = tightest(form)[real], (tighter * np.abs(upper))[real]
    if np.any(np.abs(upper[real] - least) <= slack):
        return _corner(problem, form, upper)
    upper[real] -= slack
    if problem.n_obj == 1:
        return _cheapest(problem, form, upper)
    swept = np.array([not set(form.requesting_outputs(name)).isdisjoint(problem.objectives) for name in form.outputs])
    most = upper_limit(problem, "cost")
    limit, x = upper.copy(), np.empty((0, problem.n_var))
    for _ in range(CORRECTIONS):
        x = search_vectors(problem, form, front(form, points, limit, swept, most, watch))
        if not form.exact:
            return x
        kept, excess = _by_full_model(problem, form, x[:: max(1, len(x) // SOME)], upper)
        if kept.all():
            return x
        limit = limit - excess.max(axis=0) * FURTHER
    return x


def _solved_limits(problem: ToleranceProblem, form: Form) -> Array:
    """The upper limits (r,) that are solved for, those of outputs that rows stand for included."""
    limits = row_limits(problem, form)
    for row, name in form.stands.items():
        rows = np.array([output == row for output in form.outputs])
        limit = upper_limit(problem, name)
        if np.isfinite(limit) and np.any(rows):
            limits[rows] = np.minimum(limits[rows], Provable.of(problem).stand_in_limit(name, limit))
    return limits


def _corner(problem: ToleranceProblem, form: Form, upper: Array) -> Array:
    """The search vector (one) within limits of which one is kept by the tightest tolerances alone.

    The least cost within the limits as they are, or that corner where rounding leaves nothing else.
    """
    x = search_vectors(problem, form, least_cost(form, upper[None, :]))
    if len(x) and np.all(_by_full_model(problem, form, x, upper)[0]):
        return x
    ways = tightest_ways(form)
    low = np.array([feature.ways[way].low for feature, way in zip(form.features, ways, strict=True)])
    return search_vector(problem, form, ways, low)


def _cheapest(problem: ToleranceProblem, form: Form, upper: Array) -> Array:
    """The search vector (at most one) of least cost that keeps the limits.

    Where the form understates the outputs, even by their rounding alone, it is solved again with
    limits moved by as much.
    """
    limit, x = upper.copy(), np.empty((0, problem.n_var))
    for _ in range(CORRECTIONS):
        x = search_vectors(problem, form, least_cost(form, limit[None, :]))
        kept, excess = _by_full_model(problem, form, x, upper)
        if (form.exact and kept.all()) or not np.any(excess > 0.0):
            return x
        limit = limit - excess[0] * FURTHER
    return x


def _by_full_model(problem: ToleranceProblem, form: Form, x: Array, upper: Array) -> tuple[Flags, Array]:
    """Which search vectors (k, variables) keep all limits, and the excess (k, r) over the limits of
    the form, 0 where a limit is kept.
    """
    designs = problem.complete(x)
    outputs = problem.outputs_of(designs, errors=False)
    excess = np.maximum(Provable.of(problem).form_values(form, designs, outputs) - upper, 0.0)
    return np.all(problem.violations(designs, outputs) <= 0.0, axis=1), excess
