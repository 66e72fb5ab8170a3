"""Further solutions by SLSQP on a sample: from random designs, and from designs that are given."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ..settings import Budget, Solver
from .epsilon import feasible_afresh, integer_sets, scale_of
from .local import NEARLY, Branch

if TYPE_CHECKING:
    from ..run import Run

Case = tuple[int, tuple[float, ...], float]
"""Which of two objectives is minimised, a search vector to begin from, and the level of the other one."""


@dataclass(frozen=True, slots=True)
class MultiStart(Solver):
    """The least of one objective from random designs, at every set of integers in turn; the cheapest end is
    solved again.
    """

    one_objective: ClassVar[bool] = True
    restarts: ClassVar[bool] = False
    starts: int = 5

    def solve(self, run: Run) -> None:
        problem, none, ends = run.problem, np.full(1, np.inf), []
        sets = integer_sets(problem)
        for at in range(self.starts):
            run.phase("random starts", at / self.starts)
            x = problem.xl + (problem.xu - problem.xl) * run.rng.random(problem.n_var)
            branch = Branch(run, sets[at % len(sets)], scale_of(problem))
            y = branch.solved(0, branch.smooth.scaled(x[None, :])[0], none, np.zeros(1))
            f, g = branch.smooth.values(y)
            if np.all(g <= NEARLY):
                ends.append((float(f[0]), at, branch, y))
        for _, _, branch, y in sorted(ends, key=lambda end: end[:2])[:1]:
            run.choose(feasible_afresh(run, branch, branch.solved(0, y, none, np.zeros(1)), none, search=True))


@dataclass(frozen=True, slots=True)
class Continued(Solver):
    """The least of one of two objectives from given designs, as each of the `cases` states."""

    many_objectives: ClassVar[bool] = True
    cases: tuple[Case, ...] = ()

    def solve(self, run: Run) -> None:
        aside = type(run)(run.problem, Budget(), seed=0)
        for at, (objective, start, level) in enumerate(self.cases):
            run.phase("from the front", at / len(self.cases))
            branch = Branch(aside, np.array(start), scale_of(run.problem))
            y, limit = branch.smooth.scaled(np.array([start]))[0], branch.at_most(1 - objective, level)
            branch.minimise(objective, y, limit)
            y = branch.y[0] if branch.y else y
            run.choose(feasible_afresh(aside, branch, y, limit, search=True, objective=objective))
            run.pulse()
