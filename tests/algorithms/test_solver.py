"""Algorithms that drive their own evaluations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from tolevo.algorithms.run import Progress, Run
from tolevo.algorithms.search import search
from tolevo.algorithms.settings import Budget, Solver
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.settings import Bound, PropagationSetting, Settings
from tolevo.testing import AlgorithmContract

SMALL = Settings(propagation=PropagationSetting(method="moments"), limits={"interference_probability": Bound(high=0.5)})


@dataclass(frozen=True, slots=True)
class Walk(Solver):
    """Steps from random designs, one batch after the other, in two phases."""

    many_objectives: ClassVar[bool] = True
    batch: int = 7
    batches: int = 0  # without end where it is 0

    def solve(self, run: Run) -> None:
        low, high = run.problem.xl, run.problem.xu
        run.phase("start", 0.0)
        x = low + (high - low) * run.rng.random((self.batch, run.problem.n_var))
        run.evaluate(x)
        done = 1
        while done != self.batches:
            run.phase("walk", min(1.0, done / 20.0))
            x = np.clip(x + 0.05 * (high - low) * run.rng.normal(size=x.shape), low, high)
            f, g = run.evaluate(x)
            assert len(f) == len(g) == self.batch
            done += 1


class TestWalk(AlgorithmContract):
    settings = Walk()

    def problem(self) -> RvBacklash:
        return RvBacklash(SMALL)


def test_a_budget_of_evaluations_cuts_a_batch() -> None:
    seen: list[Progress] = []
    found = search(RvBacklash(SMALL), Walk(), Budget(evaluations=17), 0, seen.append)
    assert [state.evaluations for state in seen] == [7, 14, 17]
    assert found.evaluations == 17
    assert [(state.phase, state.share) for state in seen[:2]] == [("start", 0.0), ("walk", 0.05)]


def test_generations_do_not_stop_a_solver() -> None:
    found = search(RvBacklash(SMALL), Walk(batches=6), Budget(generations=2), 0)
    assert found.evaluations == 42
    assert not found.interrupted


def test_time_limit_stops_a_solver() -> None:
    problem = RvBacklash(SMALL)
    problem.box()  # proven before the search begins, and not a matter of its limit
    found = search(problem, Walk(), Budget(time_limit_s=0.2), 0)
    assert 0.1 < found.history[-1].seconds < 2.0


def test_what_is_left_of_the_budget() -> None:
    run = Run(RvBacklash(SMALL), Budget(evaluations=10), 0)
    run.evaluate(np.tile(run.problem.xl, (4, 1)))
    assert run.evaluations_left == 6
    assert not run.spent
    assert Run(run.problem, Budget(), 0).evaluations_left is None


def test_a_solver_builds_no_pymoo_algorithm() -> None:
    with pytest.raises(TypeError, match="evaluates designs itself"):
        Walk().build(RvBacklash(SMALL))
