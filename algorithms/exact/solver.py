"""`exact`: the front in closed form where the problem has one, else by epsilon-constraints."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ...problems.forms import Form
from ...problems.limits import LIMIT_ROUNDING, loosened
from ...problems.tolerance_problem import ToleranceProblem
from ...section import POINTS, Array, Flags
from ..settings import Budget, Solver
from .bounds import LIMIT_WIDENING, apart, convex_pieces, reason, restrict_form, row_limits, upper_limit
from .choices import (
    Watch,
    best_search_vectors,
    cheapest_choice,
    cost_range,
    has_only_point_ways,
    ignore_progress,
    least_cost,
    search_vector,
    search_vectors,
    tightest_ways,
)
from .combination import Optimum, within
from .front import COARSE, front, tightest

if TYPE_CHECKING:
    from ..run import Run

ROOMIER = 0.5
"""Widening of a limit where ways are searched, in units of the room within which it counts as kept."""
POINTS_BY_DEFAULT = 1000
"""Points of an exact front."""
FEW, CORRECTED = 40, 200
"""Points of a front that is corrected by the full model, by default and at most."""
CORRECTIONS, FURTHER = 6, 1.0 + 1e-3
"""Times a limit is moved by what a form understates, and how much further than that."""
HALVINGS = 12
"""Times a move of what stands for an output is halved."""
BACK = np.array([0.0, 1e-9, 1e-7, 1e-5, 1e-3, 1e-2])
"""Fractions of the way back to a design that keeps the limits, where SLSQP ends just beyond them."""
WEIGHTS = (0.0, *np.geomspace(1e-2, 1e2, 9).tolist(), 1e4)
"""Weights of a further cost, in units of the ratio of the ranges of both."""
EARLY = 0.9
"""Fraction of the work that a closed form takes."""
CHECKED_POINTS = 3
"""Points of a front that are tested: if any breaks limits in the full model, the limits are moved."""


@dataclass(frozen=True, slots=True)
class Exact(Solver):
    """Exact front: Lagrange (Karush, Kuhn & Tucker) and branch and bound, else SLSQP."""

    many_objectives: ClassVar[bool] = True
    one_objective: ClassVar[bool] = True
    descends: ClassVar[bool] = True
    points: int = field(default=POINTS_BY_DEFAULT, metadata={"low": 2, "need": POINTS})

    def solve(self, run: Run) -> None:
        # with the solvers, which reading a configuration does not need
        from .corrected import corrected_vectors, is_corrected
        from .epsilon import choose_among_integer_sets, epsilon_front

        form = closed_form(run.problem)
        if form is None and run.problem.objectives == (run.problem.priced,):
            x = _cheapest_point_choice(run.problem)
            if len(x):
                run.choose(x)
                run.evaluate(x)
                return
        if form is None:
            if run.problem.held_costs:
                _evaluate_weighted_fronts(run, self.points)
            epsilon_front(run, self.points)
            if run.problem.held_costs and run.problem.n_obj > 2:
                choose_among_integer_sets(run, self.points)
            return
        run.phase("closed form", 0.0)
        remaining = run.evaluations_left
        points = self.points if remaining is None else max(2, min(self.points, remaining))
        if is_corrected(form):
            few = FEW if self.points == POINTS_BY_DEFAULT else CORRECTED
            x = _improve_by_full_model(run, form, corrected_vectors(run, form, min(points, few)))
            if len(x):
                run.choose(x)
                run.evaluate(x)
            return
        watch = partial(_report_optimum, run, form)
        x = _front_by_full_model(run, form, points, watch)
        if not len(x):
            x = _improve_by_full_model(run, form, exact_vectors(run.problem, form, points, watch))
        if not len(x):
            return
        inexact = run.problem.n_obj == 1 and not form.exact and not form.tested
        if form.stands or inexact:  # a report computes the represented outputs more accurately
            run.choose(x)
        early = run.evaluations > 0
        run.phase("points of the closed form", EARLY)
        _, violations = run.evaluate(x)
        if early and not form.stands and np.all(violations <= 0.0):
            run.choose(x)  # rather than points of a coarse front
        if form.tested and not np.all(violations <= 0.0):
            epsilon_front(run, self.points)


def _evaluate_weighted_fronts(run: Run, points: int) -> None:
    """Evaluate allocations of least weighted costs: each is on the front of the cost and those that are held."""
    problem = run.problem
    form = problem.form()
    if form is None or form.relaxed or not set(problem.objectives) <= {*form.outputs, *problem.cost_names}:
        return
    upper, swept = row_limits(problem, form), np.isin(form.outputs, problem.objectives)
    used = swept | np.isfinite(upper)
    columns = (problem.priced, *problem.held_costs)
    alone = [of for name in columns if (of := problem.weighted_form(form, {name: 1.0})) is not None]
    if len(alone) < len(columns) or not np.any(used):
        return
    spans = {name: float(np.ptp(cost_range(of))) for name, of in zip(columns, alone, strict=True)}
    every = [(name, weight) for name in problem.held_costs for weight in WEIGHTS]
    remaining = run.evaluations_left
    few = max(2, (points if remaining is None else min(points, remaining // 2)) // len(every))
    for at, (name, weight) in enumerate(every):
        run.phase("weighted costs", 0.3 * at / len(every))
        unit = spans[problem.priced] / max(spans[name], 1e-300)
        weighted = problem.weighted_form(form, {problem.priced: 1.0, name: weight * unit})
        if weighted is None:
            return
        for alone_in in apart(weighted):
            pieces = convex_pieces(restrict_form(alone_in, used))
            optimum = front(pieces, few, loosened(upper[used], ROOMIER), swept[used])
            x = best_search_vectors(problem, pieces, within(pieces, optimum, _strict_limits(pieces, upper[used])))
            if len(x):
                run.evaluate(x)


def _report_optimum(run: Run, form: Form, optimum: Optimum, share: float) -> None:
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
    """The form, restricted to the requirements of the problem; None where it omits any of them, or only bounds."""
    form = problem.priced_form()
    if form is None or form.relaxed or form.only_bounds or problem.held_costs or reason(problem, form):
        return None
    asked = {*problem.objectives, *(limit.name for limit in problem.limits)}
    used = np.array([not asked.isdisjoint(form.requesting_outputs(name)) for name in form.outputs])
    if not np.any(used):
        return None
    return convex_pieces(restrict_form(form, used))


def exact_vectors(
    problem: ToleranceProblem,
    form: Form,
    points: int,
    watch: Watch = ignore_progress,
    within_limits: Array | None = None,
) -> Array:
    """Search vectors (k, variables) of the exact front, or of the one least cost, within upper limits (r,) of the form,
    those of the problem if none are given.
    """
    upper = _solved_limits(problem, form) if within_limits is None else within_limits
    real = np.isfinite(upper)
    if np.any(np.abs(upper - tightest(form))[real] <= LIMIT_ROUNDING * np.abs(upper[real])):
        return _tightest_corner_design(problem, form, upper)
    if problem.n_obj == 1:
        return _cheapest_design(problem, form, upper)
    swept = np.array([not set(form.requesting_outputs(name)).isdisjoint(problem.objectives) for name in form.outputs])
    most = upper_limit(problem, problem.priced)
    limit, x = upper, np.empty((0, problem.n_var))
    for _ in range(CORRECTIONS):
        optimum = front(form, points, loosened(limit, ROOMIER), swept, float(loosened(most)), watch)
        x = best_search_vectors(problem, form, within(form, optimum, _strict_limits(form, limit)))
        if not form.exact:
            return x
        kept, excess = _check_by_full_model(problem, form, x[:: max(1, len(x) // CHECKED_POINTS)], upper)
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
            limits[rows] = np.minimum(limits[rows], problem.stand_in_limit(name, limit))
    return limits


def _improve_by_full_model(run: Run, form: Form, x: Array) -> Array:
    """The one design of least cost, or the cheap end of a front on a sample, by SLSQP on the full model, where the form
    is only a bound of that.

    Limits of a form that are moved by what it understates end near the optimum, at a place that
    depends on the way there. `x` is kept where nothing that keeps the limits is cheaper.
    """
    problem = run.problem
    alone = problem.objectives == (problem.priced,) and len(x) == 1
    on_sample = problem.n_obj == 2 and problem.priced in problem.objectives and problem.smooth() is not problem
    if form.exact or has_only_point_ways(form) or not len(x) or not (alone or on_sample):
        return x
    f, g = problem.tested(x)
    kept, cost = np.all(g <= 0.0, axis=1), f[:, problem.objectives.index(problem.priced)]
    if not np.any(kept):
        return x
    at = int(np.argmin(np.where(kept, cost, np.inf)))
    free = np.full(problem.n_obj, np.inf)
    candidates = x[[at]] if alone else np.vstack([x[[at]], _cheap_end_afresh(problem, x[at], free)])
    return np.vstack([x[:at], _cheapest_at_level(problem, candidates, free), x[at + 1 :]])


def _cheap_end_afresh(problem: ToleranceProblem, x: Array, free: Array) -> Array:
    """The cheapest search vector (1, variables) from x (variables,), with limits moved until fresh units keep them."""
    from ..run import Run
    from .epsilon import feasible_afresh, scale_of
    from .local import Branch

    run = Run(problem.smooth(), Budget(), seed=0)
    branch = Branch(run, x, scale_of(problem))
    start = branch.smooth.scaled(x[None, :])[0]
    return feasible_afresh(run, branch, start, free, search=True, objective=problem.objectives.index(problem.priced))


def _cheapest_at_level(problem: ToleranceProblem, x: Array, level: Array) -> Array:
    """The cheapest design (1, variables) by SLSQP from each of `x` (k, variables), with the integers of that, or of `x`
    itself, that keeps the limits and has objectives of at most `level` (m,); nothing where none does.
    """
    from ..run import Run
    from .epsilon import scale_of
    from .local import Branch

    objective, candidates = problem.objectives.index(problem.priced), [x]
    for start in x if not problem.declaration.sampled else ():
        branch = Branch(Run(problem.smooth(), Budget(), seed=0), start, scale_of(problem))
        if not branch.smooth.analytic or not branch.smooth.size:
            continue
        first = branch.smooth.scaled(start[None, :])[0]
        if branch.minimise(objective, first, level) is not None:
            inner = first if np.all(problem.tested(start[None, :])[1] <= 0.0) else branch.tightest(first)
            candidates.append(branch.smooth.vectors(inner + (1.0 - BACK)[:, None] * (branch.y[0] - inner)))
    tried = np.vstack(candidates)
    f, g = problem.tested(tried)
    room = LIMIT_ROUNDING * np.abs(np.where(np.isfinite(level), level, 0.0))
    kept = np.all(g <= 0.0, axis=1) & np.all(f <= level + room, axis=1)
    best = np.argmin(np.where(kept, f[:, objective], np.inf))
    return tried[[best]] if np.any(kept) else tried[:0]


def _front_by_full_model(run: Run, form: Form, points: int, watch: Watch) -> Array:
    """Search vectors (k, variables) of a front of which the form is only a bound: the points of the form's front,
    and those that break a limit in the full model solved by SLSQP on that, at their values of the other objectives.

    It ends at the least cost of the full model. Nothing where the full model has no derivatives.
    """
    problem, upper = run.problem, _solved_limits(run.problem, form)
    swept = np.array([name in problem.objectives for name in form.outputs])
    if form.exact or form.stands or problem.n_obj == 1 or not np.any(swept) or problem.declaration.sampled:
        return np.empty((0, problem.n_var))
    free = np.full(problem.n_obj, np.inf)
    cheapest = _cheapest_design(problem, form, upper)
    cheapest = _cheapest_at_level(problem, cheapest, free) if len(cheapest) else cheapest
    if not len(cheapest):
        return cheapest
    names = {name for name, moves in zip(form.outputs, swept, strict=True) if moves}
    if len(names) == 1:
        designs = problem.complete(cheapest)
        values = problem.form_values(form, designs, problem.needed_outputs(designs))[0]
        upper = np.where(swept, np.minimum(upper, values), upper)
    x = exact_vectors(problem, form, max(2, points - 1), watch, upper)
    f, g = problem.tested(x)
    most = upper_limit(problem, problem.priced)
    solved, objective = [cheapest], problem.objectives.index(problem.priced)
    for at, broken in enumerate(np.any(g > 0.0, axis=1)):
        run.phase("points on the full model", EARLY * at / len(x))
        if not broken:
            solved.append(x[[at]])
        elif f[at, objective] <= most:
            level = f[at].copy()
            level[objective] = np.inf
            solved.append(_cheapest_at_level(problem, np.vstack([x[at], solved[-1]]), level))
    return np.vstack(solved)


def _cheapest_point_choice(problem: ToleranceProblem) -> Array:
    """The cheapest choice where the form omits limits, but all its ways are points; else nothing."""
    form = problem.priced_form()
    if form is None or form.also or form.settled or not has_only_point_ways(form):
        return np.empty((0, problem.n_var))
    x = cheapest_choice(problem, form, row_limits(problem, form), -np.inf)
    return np.empty((0, problem.n_var)) if x is None else x


def _tightest_corner_design(problem: ToleranceProblem, form: Form, upper: Array) -> Array:
    """The search vector (one) within limits of which one is kept by the tightest tolerances alone.

    The least cost within the limits as they are, or that corner where rounding leaves nothing else.
    """
    x = _cheapest_at_limit(problem, form, upper)
    if len(x) and np.all(_check_by_full_model(problem, form, x, upper)[0]):
        return x
    return _tightest_design(problem, form)


def _tightest_design(problem: ToleranceProblem, form: Form) -> Array:
    """The search vector (one) of the tightest tolerances."""
    ways = tightest_ways(form)
    low = np.array([feature.ways[way].low for feature, way in zip(form.features, ways, strict=True)])
    return search_vector(problem, form, ways, low)


def _cheapest_design(problem: ToleranceProblem, form: Form, upper: Array) -> Array:
    """The search vector (at most one) of least cost that keeps the limits.

    Where the form understates the outputs, even by their rounding alone, it is solved again with
    limits moved by as much.
    """
    if has_only_point_ways(form) and not form.also:
        proven = least_cost(form, loosened(upper, LIMIT_WIDENING)[None, :]).bound[0]
        x = cheapest_choice(problem, form, upper, float(proven))
        if x is not None:
            return x
    limit, looser, x = upper, upper, np.empty((0, problem.n_var))
    for at in range(CORRECTIONS):
        x = _cheapest_at_limit(problem, form, limit)
        if not len(x):  # moved too far
            limit = np.where(looser > limit, 0.5 * (limit + looser), limit)
            continue
        kept, excess = _check_by_full_model(problem, form, x, upper)
        if (form.exact and kept.all()) or not np.any(excess > 0.0):
            return _loosest_kept(problem, form, upper, (limit, looser), x) if form.stands else x
        further = 2.0**at if form.stands else 1.0  # that no step ends just outside; then they are halved
        looser, limit = limit, limit - excess[0] * FURTHER * further
    return _tightest_design(problem, form) if form.stands else x


def _loosest_kept(problem: ToleranceProblem, form: Form, upper: Array, limits: tuple[Array, Array], x: Array) -> Array:
    """The search vector (one) at the loosest limits (r,) of the form at which it keeps those of the problem.

    At the first of the `limits` it is `x`; at the second it breaks them, where these differ. An output is not in
    proportion to what stands for it, so that limits move on while they are kept, and then are halved.
    """
    (limit, looser), standing = limits, np.isin(form.outputs, list(form.stands))
    for _ in range(CORRECTIONS if np.array_equal(limit, looser) else 0):
        designs = problem.complete(x)
        values = problem.form_values(form, designs, problem.outputs_of(designs, errors=False))[0]
        looser = limit + np.where(standing & np.isfinite(limit), FURTHER * np.maximum(upper - values, 0.0), 0.0)
        tried = _cheapest_at_limit(problem, form, looser)
        if not _check_by_full_model(problem, form, tried, upper)[0].all():
            break
        gained = problem.cost_of(problem.complete(x))[0] - problem.cost_of(problem.complete(tried))[0]
        limit, x = looser, tried
        if gained <= LIMIT_ROUNDING * abs(gained):
            return x
    for _ in range(HALVINGS if np.any(looser > limit) else 0):
        middle = np.where(looser > limit, 0.5 * (limit + looser), limit)
        tried = _cheapest_at_limit(problem, form, middle)
        if len(tried) and _check_by_full_model(problem, form, tried, upper)[0].all():
            limit, x = middle, tried
        else:
            looser = middle
    return x


def _cheapest_at_limit(problem: ToleranceProblem, form: Form, limit: Array) -> Array:
    """The search vector (at most one) of least cost at upper limits (r,) of the form.

    Ways that meet a limit exactly keep it; tolerances keep it to the last digit where these allow it.
    """
    optimum = least_cost(form, loosened(limit, ROOMIER)[None, :])
    return best_search_vectors(problem, form, within(form, optimum, _strict_limits(form, limit)))


def _strict_limits(form: Form, limit: Array) -> Array:
    """Upper limits (r,) that leave nothing to the room of rounding, which a yield has in its quantile."""
    return np.where(np.isfinite(form.own_limits), loosened(limit, -1.0), limit)


def _check_by_full_model(problem: ToleranceProblem, form: Form, x: Array, upper: Array) -> tuple[Flags, Array]:
    """Which search vectors (k, variables) keep all limits, and the excess (k, r) over the limits of
    the form, 0 where all are kept.
    """
    designs = problem.complete(x)
    outputs = problem.needed_outputs(designs)
    values = problem.form_values(form, designs, outputs)
    kept = np.all(problem.violations(designs, outputs) <= 0.0, axis=1)
    return kept, np.where(kept[:, None], 0.0, np.maximum(values - upper, 0.0))
