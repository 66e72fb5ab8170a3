"""`hybrid`: evolution from exact solutions of the convex part, then an improvement by gradients."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ..section import INDIVIDUALS, POINTS, Array
from .archive import nondominated
from .engine import GDE3Engine, Space
from .exact.bounds import convex_pieces, restrict_form, row_limits
from .exact.choices import search_vectors
from .exact.corrected import corrected_vectors, is_corrected
from .exact.epsilon import integer_moves, scale_of
from .exact.front import front
from .exact.local import Branch
from .exact.solver import closed_form, exact_vectors
from .run import Run
from .settings import Solver

EVOLVED = 0.5
"""Fraction of an evaluation budget that evolution may use."""
GENERATIONS = 100
"""Generations of the evolution where the budget states none."""
RELAXED = 24
"""Seeds from a relaxation: few suffice, because evolution moves them."""
SETS = 12
"""Sets of integers that are polished at most."""


@dataclass(frozen=True, slots=True)
class Hybrid(Solver):
    """Evolution (GDE3) from exact seeds, local improvement by SLSQP, points in the largest gaps.

    For problems that are mixed, not convex or limited in yield. `population` is per generation;
    `polish` is the number of points that gradients improve per set of integers, within as many
    evaluations as the evolution took.
    """

    many_objectives: ClassVar[bool] = True
    one_objective: ClassVar[bool] = True
    population: int = field(default=100, metadata={"low": 8, "need": INDIVIDUALS})
    polish: int = field(default=24, metadata={"low": 0, "need": POINTS})
    points: int = field(default=200, metadata={"low": 2, "need": POINTS})

    def solve(self, run: Run) -> None:
        seeds = seed_vectors(run, self.population)
        self._evolve(run, seeds)
        form = closed_form(run.problem)
        run.problem = run.problem.smooth()
        try:
            if run.problem.n_obj == 1:
                self._polish_best(run)
            elif run.problem.n_obj == 2:
                self._polish_front(run)
        finally:
            if form is not None and is_corrected(form):
                # a coarser search may have discarded seeds that are good at full accuracy
                run.choose(np.vstack([seeds, run.archive.arrays()[0]]))

    def _evolve(self, run: Run, seeds: Array) -> None:
        """GDE3 on arrays, until the generations or its part of the evaluations are used up."""
        space, remaining = Space.of(run.problem), run.evaluations_left
        engine = GDE3Engine(space, self.population, run.rng)
        drawn = space.draw(max(self.population - len(seeds) // 2, self.population // 2), run.rng)
        first = np.vstack([seeds, drawn])
        run.phase("seeds", 0.0)
        f, g = run.evaluate(first)
        told = ((run.start, first), (run.begun[0], f), (run.begun[1], g))
        engine.tell(*(np.concatenate(pair) for pair in told))
        total = run.budget.generations or GENERATIONS
        end = None if remaining is None else run.evaluations + EVOLVED * remaining
        for generation in range(total):
            if end is not None and run.evaluations >= end:
                return
            run.phase("evolution", EVOLVED * generation / total)
            x = engine.ask()
            engine.tell(x, *run.evaluate(x))

    def _polish_best(self, run: Run) -> None:
        """One objective: minimise from the best design, at its integers and at all sets of integers
        that differ from them in one; then the same from every improvement.
        """
        if not run.archive.has_values:
            return
        unit, free, tried = scale_of(run.problem), np.array([np.inf]), set[bytes]()
        start, best = _best_design(run)
        while True:
            moves = [x for x in integer_moves(run.problem, start) if _integers(run, x) not in tried]
            if not moves:
                return
            run.phase("polish", 1.0 - (1.0 - EVOLVED) / (1.0 + len(tried) / SETS))
            tried.add(_integers(run, moves[0]))
            branch = Branch(run, moves[0], unit)
            branch.minimise(0, branch.smooth.scaled(start[None, :])[0], free)
            found, sampled = _best_design(run), run.problem.declaration.sampled
            if sampled and branch.f:  # it keeps its limits nearly, and is moved inside them at the end
                polished = branch.smooth.vectors(branch.y[0][None, :])[0], float(branch.f[0][0])
                found = min(found, polished, key=lambda design: design[1])
            if found[1] < best:
                start, best = found
                run.choose(start[None, :] if sampled else run.chosen[:0])

    def _polish_front(self, run: Run) -> None:
        """Two objectives: gradients where the front has its largest gaps, then interpolated points."""
        x, f = run.archive.arrays()
        if not len(x):
            return
        kept = nondominated(f)
        branches = branches_of(run, x[kept], f[kept], SETS)
        start, most = run.evaluations, self.polish * len(branches)
        for done in range(most):
            run.phase("polish", EVOLVED + 0.45 * done / most)
            widest = max(branches, key=lambda branch: branch.widest()[0])
            if run.evaluations > 2 * start or not widest.halve():
                break
        run.phase("interpolated points", 0.95)
        for branch in branches:
            run.evaluate(branch.between(max(2, self.points // len(branches))))


def seed_vectors(run: Run, count: int) -> Array:
    """Search vectors (k, variables) from the convex form, exact or a relaxation; none without one.

    Variables that a relaxation settles are drawn at random for half of the seeds: the limits that
    it omits may forbid the value that is best for it.
    """
    problem, form = run.problem, run.problem.guide()
    if form is None or problem.priced != "cost" or "cost" not in problem.objectives:
        return np.empty((0, problem.n_var))
    closed = closed_form(problem)
    if closed is not None and is_corrected(closed):
        return corrected_vectors(run, closed, min(count, RELAXED))
    if closed is not None:
        return exact_vectors(problem, closed, count)
    upper = row_limits(problem, form)[:1]
    form = convex_pieces(restrict_form(form, np.arange(len(form.outputs)) == 0))
    seeds = search_vectors(problem, form, front(form, min(count, RELAXED), upper))
    settled = np.array([v.name in form.settled for v in problem.free])
    drawn = problem.xl + (problem.xu - problem.xl) * run.rng.random(seeds.shape)
    half = (np.arange(len(seeds)) % 2 == 0)[:, None]
    return np.where(half & settled, drawn, seeds)


def branches_of(run: Run, x: Array, f: Array, most: int) -> list[Branch]:
    """A branch per set of integers on a front (n, variables), those with most points first.

    Every branch adopts some of its points, evenly along the front.
    """
    integer = np.array([v.integer for v in run.problem.free])
    _, owner, counts = np.unique(x[:, integer], axis=0, return_inverse=True, return_counts=True)
    branches = []
    for index in np.argsort(-counts, kind="stable")[:most]:
        rows = np.flatnonzero(np.ravel(owner) == index)
        rows = rows[np.argsort(f[rows, 1], kind="stable")]
        some = rows[np.unique(np.linspace(0, len(rows) - 1, 16).astype(int))]
        branch = Branch(run, x[some[0]], scale_of(run.problem))
        branch.adopt(x[some], f[some])
        branches.append(branch)
    return branches


def _best_design(run: Run) -> tuple[Array, float]:
    """The best design of one objective and its value; the least violating if none is feasible."""
    x, f = run.archive.arrays()
    if not len(x):
        return run.archive.miss[0], np.inf
    at = int(np.argmin(f[:, 0]))
    return x[at], float(f[at, 0])


def _integers(run: Run, x: Array) -> bytes:
    """The integers of a design, as a key."""
    return np.rint(x[[v.integer for v in run.problem.free]]).tobytes()
