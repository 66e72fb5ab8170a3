"""The front by epsilon-constraints, for models without closed form.

The first objective is minimised under limits on the others (Haimes, Lasdon & Wismer 1971) by SLSQP,
from the neighbours on the front. The rectangle between two neighbours bounds the unknown part of the
front: the largest rectangle is halved next. Between the solved points, the scaled tolerances are
interpolated along the front, with one evaluation a point. Integers are enumerated; sets of integers
that contribute nothing to a coarse front are dropped.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...errors import Fault, raise_all
from ...problems.tolerance_problem import ToleranceProblem
from ...section import Array, Flags
from ..archive import nondominated
from ..run import BudgetSpent, Run, recalled_results
from ..settings import Budget
from .combination import arc_length
from .descent import Descents
from .local import NEARLY, Branch, joint_front, joint_front_points

# The end of a search on a sample: its points are tested on fresh units, and solved again.
#
# A search on one sample fits the chance in it: its limits hold there to the last digit, and on fresh
# units half of its points would break them. Therefore every point is solved again with its limits
# moved by the excess on fresh units.


ROUNDS, ALONE, SPARE = 3, 6, 4
"""Times that a point of a front, or a single point, is solved with its limits moved, and further
times that it is moved inside them where it is not."""
BEYOND, MARGIN = 1.2, 3e-4
"""Factor and fraction of a limit by which it is moved farther than fresh units require, so that
few rounds suffice."""
OF_TAIL = 0.02
"""Fraction of the distance from a lower limit on a percentage to 100, by which it is moved
farther."""
SAME, CHEAPER = 1e-9, 3e-3
"""Difference between two samples that is none, and the fraction by which the end of a search is cheaper than that of
descents on fresh units, to be taken instead: it may hang on a last digit, which theirs does not."""
HELD = 3e-5
"""Part of the range of an objective by which a point may lie beyond its level."""
GROUP = 18
"""Points that are solved again side by side, and stored together for a run that resumes."""
MAX_RESTORATION_STEP = 0.5
"""Fraction of a limit by which it is moved at most."""


def submit_retested_points(
    run: Run,
    points: Sequence[Sequence[tuple[Branch, int]]],
    levels: Sequence[float] = (),
    descents: Descents | None = None,
) -> None:
    """Hand the best of each of the `points`, candidates by branch and index, to the run as its result, at the levels
    of the second objective where there are some.

    A point that breaks a limit on fresh units is solved again with the limit moved by the excess.
    """
    candidates = [
        Candidate(branch, branch.y[at], branch.at_most(1, levels[place]) if len(levels) else np.full(1, np.inf))
        for place, alike in enumerate(points)
        for branch, at in alike
    ]
    apart = len(levels) > 0 and run.problem.finer() is not run.problem
    solved: list[Array] = []
    while len(solved) < len(candidates):
        run.phase("fresh units", 0.9 + 0.1 * len(solved) / len(candidates))
        if apart and not run.spent:
            solved.extend(_solved_apart(run, candidates[len(solved) :][:GROUP]))
        else:
            branch, y, level = candidates[len(solved)]
            solved.append(feasible_afresh(run, branch, y, level, search=not run.spent, descents=descents))
    for place, alike in enumerate(points):
        found, solved = solved[: len(alike)], solved[len(alike) :]
        run.choose(found[0] if len(found) == 1 else _cheapest(run, np.vstack(found), levels[place]))


class Candidate(NamedTuple):
    """A point y (size,) of a branch, to be solved again at a level (m,) of the objectives."""

    branch: Branch
    y: Array
    level: Array


class Retest(NamedTuple):
    """The same for another process: the integers of the branch as a search vector x, and its scale of objectives."""

    x: Array
    unit: Array
    y: Array
    level: Array


def _solved_apart(run: Run, candidates: Sequence[Candidate]) -> Array:
    """Search vectors (n, 1, variables) of candidates, each of which is solved on its own."""
    run.pulse()
    tasks = [Retest(branch.smooth.x, branch.unit, y, level) for branch, y, level in candidates]
    return recalled_results(run.results, retested, tasks, [array for task in tasks for array in task])


def retested(problem: ToleranceProblem, task: Retest) -> Array:
    """The search vector (1, variables) of a task, solved again on more units and tested on fresh ones."""
    run = Run(problem, Budget(), seed=0)
    return feasible_afresh(run, Branch(run, task.x, task.unit), task.y, task.level, search=True)


def _cheapest(run: Run, x: Array, level: float) -> Array:
    """The search vector (1, variables) of the least first objective of those (n, variables) that keep the limits and
    the level of the second one on fresh units.
    """
    f, g = run.problem.tested(x)
    beyond = (f[:, 1] > level + HELD * scale_of(run.problem)[1]) | np.any(g > 0.0, axis=1)
    return x[np.lexsort([f[:, 0], beyond])[:1]]


def feasible_afresh(
    run: Run, branch: Branch, y: Array, level: Array, search: bool, objective: int = 0, descents: Descents | None = None
) -> Array:
    """The search vector (1, variables) of a point, after its limits hold on fresh units.

    With `search` it is solved again on the larger sample of the problem, with the other objectives at
    most at their `level` (m,), and these and every limit moved by the difference between fresh units and
    that sample, until little room is left. The best point accepted on fresh units is taken; where none holds
    its level, the last one, moved inside its limits, if that is nearer. With `descents` a single objective is
    minimised on the fresh units themselves as well, from other starts, where no point is accepted, where SLSQP did
    not reach the limits that were moved, or where few units decide: it may have ended on a kink of a sample. Their
    point is taken unless the accepted one is cheaper by more than `CHEAPER`.
    """

    def above(fresh: Array) -> float:
        """The excess over the level, in units of the objectives."""
        return float(np.delete((fresh - level) / branch.unit, objective).max(initial=0.0))

    accepted: list[tuple[float, float, Array]] = []
    displacement, moved, target, stuck = _limit_displacement(run), np.zeros(0), level, False
    if search and (finer := run.problem.finer()) is not run.problem:
        branch = branch.on(finer)
    rounds = ALONE if run.problem.n_obj == 1 else ROUNDS
    for left in range(rounds if search else 0, -1, -1):
        x = branch.smooth.vectors(y[None, :])
        (fresh,), (excess,) = run.problem.tested(x)
        over = above(fresh)
        if np.all(excess <= 0.0):
            accepted.append((max(over - HELD, 0.0), float(fresh[objective]), x))
        (values, violation), excess = branch.smooth.values(y), branch.smooth.constraints(excess)[0]
        binding = len(moved) > 0 and violation + moved >= -NEARLY
        used_up = np.all(excess <= 0.0) and np.all(excess[binding] >= -2.0 * displacement[binding])
        if not left or (len(moved) and used_up and over <= HELD):
            break
        moved = np.where(np.abs(excess - violation) > SAME, excess - violation + displacement, 0.0)
        differs = np.abs(fresh - values) > SAME * np.abs(values)
        target = level - np.where(differs, fresh - values + MARGIN * np.abs(values), 0.0)
        target[objective] = np.inf
        y = branch.solved(objective, branch.restored(y, moved, MAX_RESTORATION_STEP), target, moved)
        stuck = stuck or bool(np.any(branch.smooth.values(y)[1] + moved > NEARLY))
    accepted.sort(key=lambda point: point[:2])
    if search and descents is not None and (stuck or not accepted or descents.few_units):
        found = descents.cheapest(integer_moves(run.problem, branch.smooth.x), branch.unit)
        if found is not None:
            own, least = accepted[0][1] if accepted else np.inf, run.problem.tested(found)[0].item()
            return found if least <= own + CHEAPER * abs(own) else accepted[0][2]
    if accepted and not (search and accepted[0][0]):
        return accepted[0][2]
    x = _push_inside_limits(run, branch, y)  # the last one, where none holds its level
    (fresh,), (excess,) = run.problem.tested(x)
    return x if not accepted or (np.all(excess <= 0.0) and above(fresh) - HELD < accepted[0][0]) else accepted[0][2]


def _push_inside_limits(run: Run, branch: Branch, y: Array) -> Array:
    """The search vector (1, variables) of a point that is moved inside its limits on fresh units."""
    slack, farther = np.zeros(run.problem.n_ieq_constr), _limit_displacement(run)
    for _ in range(SPARE):
        x = branch.smooth.vectors(y[None, :])
        excess = branch.smooth.constraints(run.problem.tested(x)[1][0])[0]
        if not np.any(excess > 0.0):
            break
        violation = branch.smooth.values(y)[1]
        slack = np.where(excess > 0.0, np.maximum(slack, -violation) + BEYOND * excess + farther, slack)
        y = branch.restored(y, slack, MAX_RESTORATION_STEP)
    else:
        y = branch.moved_inside(
            y,
            branch.tightest(y),
            lambda at: not np.any(run.problem.tested(branch.smooth.vectors(at[None, :]))[1] > 0.0),
        )
    return branch.smooth.vectors(y[None, :])


def _limit_displacement(run: Run) -> Array:
    """The fraction by which limits (constraints,) are moved beyond what fresh units require."""
    fractions = []
    for limit in run.problem.limits:
        tail = 100.0 - limit.low if limit.of_percentage else np.inf
        fraction = OF_TAIL * tail / limit.low if 0.0 < tail < limit.low else MARGIN
        fractions += [min(MARGIN, fraction)] * limit.count
    return np.array(fractions)


# A front on a sample by continuation: level after level of the second objective, warm started.
#
# At every level the first objective is minimised at each set of integers that may be best there, from
# the designs at the neighbouring levels. A set that is worse by more than `BEATEN` at both of them is
# omitted.


RATIO = 0.75
"""Ratio of neighbouring levels of the coarse front."""
BEATEN = 0.02
"""Fraction of the least value by which a set of integers is worse where it is not tried between."""
CLOSE = 0.007
"""Fraction within which the next set of integers may be the better one on more units."""
STEPS = 3
"""Steps to a level that is not reached at once."""
SWEEPS, SAGGING = 2, 1e-3
"""Times that points are solved again from their neighbours, and the excess over the chord of both
from which that is done, in natural logarithms."""
END = 1.03
"""The tight end of the front, as a multiple of the second objective of the tightest tolerances, which is
the same on every processor: beyond it the cost rises without bound, and chance dominates."""
Levels = dict[float, Array]


def sampled_front(run: Run, branches: list[Branch], points: int) -> None:
    """Compute the front of one or two objectives of a sampled problem, tested on fresh units."""
    if run.problem.n_obj == 1:
        for at, branch in enumerate(branches):
            run.phase("least value", 0.8 * at / len(branches))
            branch.begin(run)
        alive = [branch for branch in branches if branch.f]
        submit_retested_points(run, [joint_front_points(alive)[:1]] if alive else [], descents=Descents.of(run))
    else:
        levels = _fill_between_levels(run, branches, points)
        submit_retested_points(run, [_best_branch_points(branches, level) for level in sorted(levels)], sorted(levels))
        run.chosen = nondominated_feasible_designs(run.problem, run.chosen)


def nondominated_feasible_designs(problem: ToleranceProblem, x: Array) -> Array:
    """The search vectors (k, variables) that none of those (n, variables) that keep the limits dominates.

    On fresh units a point may come out both dearer and looser than its neighbours: the rounding of a
    processor decides which, and a front has no such end. Points that break a limit by more than what a move
    of it mends are left out where others keep it.
    """
    if not len(x):
        return x
    f, g = problem.tested(x)
    kept = f[np.all(g <= 0.0, axis=1)]
    lost = np.any(g > NEARLY, axis=1) & (len(kept) > 0)
    dominated = [np.any(np.all(kept <= point, axis=1) & np.any(kept < point, axis=1)) for point in f]
    return np.asarray(x[~(lost | np.array(dominated))])


def _fill_between_levels(run: Run, branches: list[Branch], points: int) -> Levels:
    """Solve at coarse levels, then where the joint front is widest, until it has `points`."""
    levels = _solve_coarse_levels(run, branches)
    while levels and len(levels) < points:
        run.phase("largest gaps of the front", 0.4 + 0.5 * len(levels) / points)
        below, above = _widest_gap(levels, branches[0].unit)
        level = 0.5 * (below + above)
        tried = _promising_integer_sets(levels[below]) | _promising_integer_sets(levels[above])
        levels[level] = np.array(
            [
                _solve_level(branch, level) if promising else np.inf
                for branch, promising in zip(branches, tried, strict=True)
            ]
        )
    for sweep in range(SWEEPS):
        run.phase("points from their neighbours", 0.8 + 0.1 * sweep / SWEEPS)
        if not _improve_nonconvex_points(branches, levels):
            break
    return levels


def _improve_nonconvex_points(branches: list[Branch], levels: Levels) -> bool:
    """Solve points above the chord of their neighbours again from there; whether there were any.

    On doubly logarithmic axes a front is convex, but for kinks where the integers change.
    """
    order = sorted(levels)
    if len(order) < 3:
        return False
    least = np.log([np.min(levels[level]) for level in order])
    at = np.log(order)
    fraction = (at[1:-1] - at[:-2]) / (at[2:] - at[:-2])
    above = least[1:-1] - (1.0 - fraction) * least[:-2] - fraction * least[2:]
    bad = [order[i + 1] for i in np.flatnonzero(above > SAGGING)]
    for level in bad:
        branch = branches[int(np.argmin(levels[level]))]
        for other_level in (order[order.index(level) - 1], order[order.index(level) + 1]):
            near = branches[int(np.argmin(levels[other_level]))]
            near.minimise(0, near.nearest(other_level), near.at_most(1, level))
            if near is not branch:
                branch.minimise(0, near.nearest(other_level), branch.at_most(1, level))
        levels[level] = np.array([_value(candidate, level) for candidate in branches])
    return bool(bad)


def _solve_coarse_levels(run: Run, branches: list[Branch]) -> Levels:
    """From the cheapest design of every set of integers to tighter levels, as far as possible."""
    none = np.full(len(branches[0].unit), np.inf)
    for at, branch in enumerate(branches):
        run.phase("coarse front", 0.4 * at / len(branches))
        start = branch.starts(run)[-1]
        branch.minimise(0, start, none)
        if branch.f:
            branch.minimise(1, branch.y[0], branch.at_most(0, branch.f[0][0] * (1.0 + 1e-6)))
        while branch.f:
            tightest = branch.f[0][1]
            branch.minimise(0, branch.y[0], branch.at_most(1, RATIO * tightest))
            if branch.f[0][1] > 0.95 * tightest:
                break
    high = max((branch.f[-1][1] for branch in branches if branch.f), default=np.nan)
    last = min((b for b in branches if b.f), key=lambda b: b.f[0][1], default=None)
    if last is None:
        return {}
    last.minimise(1, last.tightest(last.y[0]), none)
    finest = last.on(run.problem.finer())
    finest.minimise(1, last.tightest(last.y[0]), none)
    low = END * max(branch.f[0][1] for branch in (last, finest) if branch.f)
    count = int(np.ceil(np.log(low / high) / np.log(RATIO)))
    levels = np.geomspace(low, high, max(count, 2) + 1).tolist()
    return {level: np.array([_solve_level(b, level) for b in branches]) for level in levels}


def _promising_integer_sets(values: Array) -> Flags:
    """Which sets of integers (n,) are good enough at a level; a set that is not tried is not."""
    return np.asarray(values <= (1.0 + BEATEN) * np.min(values))


def _widest_gap(levels: dict[float, Array], unit: Array) -> tuple[float, float]:
    """The neighbouring levels between which the joint front has its largest gap."""
    order = sorted(levels)
    least = np.array([np.min(levels[level]) for level in order])
    drop = np.where(np.isfinite(least[:-1]), -np.diff(least), unit[0]) / unit[0]
    at = int(np.argmax(np.maximum(drop, 1e-9) * np.diff(order) / unit[1]))
    return order[at], order[at + 1]


def _value(branch: Branch, level: float) -> float:
    """The least first objective that a branch has at a level, or nearly there."""
    return min(_attained_objectives(branch, level), default=np.inf)


def _attained_objectives(branch: Branch, level: float) -> list[float]:
    """First objectives of the points of a branch up to a level, or nearly there."""
    return [float(f[0]) for f in branch.f if f[1] <= level + NEARLY * branch.unit[1]]


def _best_branch_points(branches: list[Branch], level: float) -> list[tuple[Branch, int]]:
    """Branch and index of the least first objective at a level, and of the next set of integers where that may be
    better on more units: other points there are not part of the front, though some are tighter by less than the
    accuracy of a solution.
    """
    first, *others = sorted(branches, key=lambda candidate: _value(candidate, level))
    close = [other for other in others[:1] if _value(other, level) <= (1.0 + CLOSE) * _value(first, level)]
    return [(branch, int(np.argmin(_attained_objectives(branch, level)))) for branch in (first, *close)]


def _solve_level(branch: Branch, level: float) -> float:
    """The least first objective at a level, from between its neighbours, else from the tighter."""
    limit = branch.at_most(1, level)
    values = np.array([f[1] for f in branch.f])
    above = int(np.searchsorted(values, level))
    if above == 0:  # tighter than the branch reaches
        return np.inf
    tighter, cost_there = branch.y[above - 1], float(branch.f[above - 1][0])
    if above < len(values):
        fraction = (level - values[above - 1]) / max(values[above] - values[above - 1], 1e-12)
        branch.minimise(0, tighter + fraction * (branch.y[above] - tighter), limit)
    if _value(branch, level) > 0.999 * cost_there:
        branch.minimise(0, tighter, limit)
    if _value(branch, level) > 0.999 * cost_there:
        _step_to_level(branch, level)
    return _value(branch, level)


def _step_to_level(branch: Branch, level: float) -> None:
    """From the next looser point to a level in steps, where a larger step does not lead there."""
    looser = [f[1] for f in branch.f if f[1] > level]
    if not looser:
        return
    for target in np.geomspace(min(looser), level, STEPS + 1)[1:]:
        start = branch.nearest(float(min(f[1] for f in branch.f if f[1] >= target)))
        branch.minimise(0, start, branch.at_most(1, float(target)))


SETS = 64
"""Sets of integers that are enumerated at most."""
COARSE_LEVELS = 5
"""Points per set of integers before sets are dropped."""
SOLVED = 48
"""Points that are solved; the others are interpolated between them."""


def epsilon_front(run: Run, points: int) -> None:
    """Evaluate designs along the front of a run's problem; `points` are spread over it."""
    problem = run.problem = run.problem.smooth()
    unit = scale_of(problem)
    branches = [Branch(run, x, unit) for x in integer_sets(problem)]
    if problem.declaration.sampled:
        sampled_front(run, branches, points)
        return
    for at, branch in enumerate(branches):
        run.phase("ends of the front" if problem.n_obj > 1 else "least cost", 0.2 * at / len(branches))
        branch.begin(run)
    alive = [branch for branch in branches if branch.f]
    if alive and problem.n_obj == 2:
        _front(run, alive, points)
        if problem.settings.operating is not None:  # each reported point is verified in every condition
            run.choose(_evenly_along_front(run, points))


def _evenly_along_front(run: Run, points: int) -> Array:
    """At most so many search vectors (n, variables) of the front of two objectives, evenly by its arc length."""
    x, f = run.archive.arrays()
    rows = np.flatnonzero(nondominated(f))
    rows = rows[np.argsort(f[rows, 0], kind="stable")]
    if not len(rows):
        return x
    length = arc_length(f[rows].T)
    return np.asarray(x[rows[np.unique(np.searchsorted(length, np.linspace(0.0, length[-1], points)))]])


def _front(run: Run, alive: list[Branch], points: int) -> None:
    """From the ends of two objectives to the whole front."""
    for at, branch in enumerate(alive):
        run.phase("coarse front", 0.2 + 0.1 * at / len(alive))
        for _ in range(COARSE_LEVELS):
            branch.halve()
    alive = _branches_on_front(alive)
    _fill(run, alive, max(2, min(SOLVED, points)))
    run.phase("interpolated points", 0.9)
    for branch in alive:
        run.evaluate(branch.between(max(2, points // len(alive))))


def _fill(run: Run, branches: list[Branch], points: int) -> None:
    """Solve in the largest rectangles until the joint front has so many points."""
    while len(joint := joint_front(branches)) < points:
        run.phase("largest gaps of the front", 0.3 + 0.6 * len(joint) / points)
        widest = max(branches, key=lambda branch: branch.widest(joint)[0])
        if not widest.halve(joint):
            return


def scale_of(problem: ToleranceProblem) -> Array:
    """Scale (m,) of the objectives."""
    ideal, nadir = problem.box()
    return nadir - ideal


def integer_sets(problem: ToleranceProblem) -> list[Array]:
    """Search vectors (variables,) with every set of values of the integer variables.

    Raises InputError where there are more than `SETS`.
    """
    raise_all(integer_faults(problem))
    return [np.array(values) for values in itertools.product(*_choices(problem))]


def integer_faults(problem: ToleranceProblem) -> list[Fault]:
    """A fault where there are more sets of integers than are enumerated."""
    count = int(np.prod([float(len(choice)) for choice in _choices(problem)]))
    if count <= SETS:
        return []
    text = (
        f"exact enumerates at most {SETS} sets of integers for a problem without closed form, "
        f"but this problem has {count}: use hybrid, or fix some of them"
    )
    return [Fault("algorithm.name", text)]


def _choices(problem: ToleranceProblem) -> list[Array]:
    """The values of every integer variable, and one value of every other."""
    return [
        np.arange(np.ceil(low), np.floor(high) + 1.0) if v.integer else np.array([low])
        for v, low, high in zip(problem.free, problem.xl, problem.xu, strict=True)
    ]


def integer_moves(problem: ToleranceProblem, x: Array) -> list[Array]:
    """A search vector (variables,) and those that differ from it in one integer."""
    vectors = [x]
    for at, variable in enumerate(problem.free):
        if variable.integer:
            for value in np.arange(np.ceil(problem.xl[at]), np.floor(problem.xu[at]) + 1.0):
                if value != np.rint(x[at]):
                    moved = x.copy()
                    moved[at] = value
                    vectors.append(moved)
    return vectors


def _branches_on_front(branches: list[Branch]) -> list[Branch]:
    """The branches with a point on the joint front of their coarse points."""
    f = np.vstack([np.array(branch.f) for branch in branches])
    owner = np.repeat(np.arange(len(branches)), [len(branch.f) for branch in branches])
    kept = set(owner[nondominated(f)].tolist())
    return [branch for at, branch in enumerate(branches) if at in kept]


# The end of a search on a sample: its front on fresh units, improved by gradients where asked.


POINTS = 40
"""Points of a front that are tested on fresh units at most."""
STARTS = 4
"""Further designs that are solved at most, where a search kept the limits nowhere."""
CANDIDATES = 500
"""Designs of the archive that take the place of a result of which no point keeps its limits."""


def finish_front(run: Run, polish: bool, restarts: bool = True, descends: bool = False) -> None:
    """Make the front of the run its result, after its limits hold on fresh units.

    With `polish` every point is first improved by SLSQP at its own value of the other objectives,
    within the budget of evaluations. Where no design kept the limits, that of the least violation and, with
    `restarts`, the starts of the problem are solved instead, until one keeps them; where a search `descends`, by
    descents on fresh units as well. Tests on fresh units, and the moves that they require, do not count as evaluations.
    """
    x = _select_along_front(run)
    aside = Run(run.problem, Budget(evaluations=run.evaluations_left), seed=0)
    free, unit = Run(run.problem, Budget(), seed=0), scale_of(run.problem)
    for done, vector in enumerate(x):
        run.phase("polish" if polish else "fresh units", done / len(x))
        if polish:
            vector = _polish_design(aside, vector, unit)
        branch = Branch(free, vector, unit)
        y = branch.smooth.scaled(vector[None, :])[0]
        run.choose(feasible_afresh(free, branch, y, branch.smooth.values(y)[0], search=polish))
    descents = Descents.of(run) if descends else None
    for vector in run.archive.miss if not len(x) else x[:0]:
        branch, none = Branch(free, vector, unit), np.full(len(unit), np.inf)
        for y in np.vstack([branch.smooth.scaled(vector[None, :]), branch.starts(free)[: STARTS if restarts else 0]]):
            y = branch.solved(0, y, none, np.zeros(1))
            run.choose(feasible_afresh(free, branch, y, none, search=True, descents=descents))
            if np.any(np.all(run.problem.tested(run.chosen)[1] <= 0.0, axis=1)):
                break
    if polish:
        run.evaluations += aside.evaluations


def choose_among_integer_sets(run: Run, points: int) -> None:
    """Make points along the front of the archive the result, each the best of all sets of integers at its own values.

    At most `SOLVED` points: where several objectives besides the first are held, each of them is solved in every set.
    Once the budget is spent, the points that are left stay as they are in the archive.
    """
    unit, sets = scale_of(run.problem), integer_sets(run.problem)
    limit_s = run.budget.time_limit_s
    left = None if limit_s is None else limit_s - run.seconds
    aside = Run(run.problem, Budget(evaluations=run.evaluations_left, time_limit_s=left), seed=0)
    x = _select_along_front(run, min(points, SOLVED))
    for done, (vector, own) in enumerate(zip(x, run.problem.searched(x)[0], strict=True)):
        run.phase("points in every set of integers", done / len(x))
        limit, least, best = np.concatenate([[np.inf], own[1:]]), own[0], vector
        for integers in sets:
            branch = Branch(aside, integers, unit)
            try:
                values = branch.minimise(0, branch.smooth.scaled(vector[None, :])[0], limit)
            except BudgetSpent:
                break
            if values is not None and values[0] < least and np.all(values <= limit + NEARLY * unit):
                least, best = values[0], branch.smooth.vectors(branch.y[0][None, :])[0]
        run.choose(best[None, :])
        if aside.spent:
            run.choose(x[done + 1 :])
            break
    run.evaluations += aside.evaluations


def replace_violating_points(run: Run) -> None:
    """Replace points of the result that break a limit as reported, though they keep it in the search.

    A single point is solved again with its limits moved by the difference, in any case where they take
    a sample: it may keep them with a margin by chance. Points of a front are moved inside their limits.
    Where none keeps them after that, others of the archive are candidates.
    """
    problem, alone, x = run.problem, run.problem.n_obj == 1, run.chosen
    smooth = problem.smooth()
    sampled = smooth is not problem
    if not (alone or sampled):
        return
    archived = run.archive.arrays()[0]
    if not len(x):
        x = _select_along_front(run, max(POINTS, len(archived)))
    if not len(x) and sampled:
        x = run.archive.miss
    if not len(x):
        return
    f, g = problem.tested(x)
    broken = ~np.all(g <= 0.0, axis=1)
    if not np.all(broken) and not (sampled and (alone or np.any(broken))):
        return
    rows = np.flatnonzero(broken)
    if alone:
        rows = np.lexsort([f[:, 0], broken])[:1]
    free, unit = Run(smooth, Budget(), seed=0), scale_of(problem)
    run.chosen = x[~broken]
    for done, vector in enumerate(x[rows[np.unique(np.linspace(0, len(rows) - 1, POINTS).astype(int))]]):
        run.phase("fresh units", done / len(rows))
        branch = Branch(free, vector, unit)
        y = branch.smooth.scaled(vector[None, :])[0]
        run.choose(feasible_afresh(free, branch, y, branch.smooth.values(y)[0], search=alone))
    if len(archived) and np.all(np.any(problem.tested(run.chosen)[1] > 0.0, axis=1)):
        order = np.lexsort(run.archive.arrays()[1].T[::-1])
        run.choose(archived[order[np.unique(np.linspace(0, len(order) - 1, CANDIDATES).astype(int))]])


def _select_along_front(run: Run, most: int = POINTS) -> Array:
    """Search vectors (n, variables) along the front of the archive, at most so many."""
    x, f = run.archive.arrays()
    if not len(x):
        return x
    if f.shape[1] == 1:
        return np.asarray(x[[int(np.argmin(f[:, 0]))]])
    rows = np.flatnonzero(nondominated(f))
    rows = rows[np.lexsort(f[rows].T[::-1])]
    some = np.unique(np.linspace(0, len(rows) - 1, most).astype(int))
    return np.asarray(x[rows[some]])


def _polish_design(run: Run, x: Array, unit: Array) -> Array:
    """The search vector after SLSQP on its first objective, the others held."""
    try:
        branch = Branch(run, x, unit)
        y = branch.smooth.scaled(x[None, :])[0]
        limit = branch.smooth.values(y)[0].copy()
        limit[0] = np.inf
        objectives = branch.minimise(0, y, limit)
    except BudgetSpent:
        return x
    if objectives is None:
        return x
    return np.asarray(branch.smooth.vectors(branch.y[0][None, :])[0])
