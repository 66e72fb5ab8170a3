"""The end of a search on a sample: its front on fresh units, improved by gradients where asked."""

from __future__ import annotations

import numpy as np

from ...arrays import Array
from ...problems.interfaces import Accuracy
from ..indicators import nondominated
from ..run import BudgetSpent, Run
from ..settings import Budget
from .afresh import feasible_afresh
from .branch import Branch
from .epsilon import scale_of

POINTS = 40
"""Points of a front that are tested on fresh units at most."""
CANDIDATES = 500
"""Designs of the archive that take the place of a result of which no point keeps its limits."""


def finished(run: Run, polish: bool) -> None:
    """Make the front of the run its result, after its limits hold on fresh units.

    With `polish` every point is first improved by SLSQP at its own value of the other objectives,
    within the budget of evaluations. Tests on fresh units, and the moves that they require, do not
    count as evaluations.
    """
    x = _front(run)
    aside = Run(run.problem, Budget(evaluations=run.evaluations_left), seed=0)
    free, unit = Run(run.problem, Budget(), seed=0), scale_of(run.problem)
    for done, vector in enumerate(x):
        run.phase("polish" if polish else "fresh units", done / len(x))
        if polish:
            vector = _polished(aside, vector, unit)
        branch = Branch(free, vector, unit)
        y = branch.smooth.scaled(vector[None, :])[0]
        run.choose(feasible_afresh(free, branch, y, branch.smooth.values(y)[0], search=polish))
    if polish:
        run.evaluations += aside.evaluations


def secured(run: Run) -> None:
    """Replace points of the result that break a limit as reported, though they keep it in the search.

    A single point is solved again with its limits moved by the difference, in any case where they take
    a sample: it may keep them with a margin by chance. Points of a front are moved inside their limits.
    Where none keeps them after that, others of the archive are candidates.
    """
    problem, alone, x = run.problem, run.problem.n_obj == 1, run.chosen
    smooth = Accuracy.of(problem).smooth()
    sampled = smooth is not problem
    if not (alone or sampled):
        return
    archived = run.archive.arrays()[0]
    if not len(x):
        x = _front(run, max(POINTS, len(archived)))
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


def _front(run: Run, most: int = POINTS) -> Array:
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


def _polished(run: Run, x: Array, unit: Array) -> Array:
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
