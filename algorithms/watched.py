"""A search that records its course alone, as one of the many runs of a study."""

from __future__ import annotations

import time

from ..arrays import Array
from ..errors import ModelError
from ..problems.tolerance_problem import ToleranceProblem
from .course import Course
from .run import Run
from .search import drive
from .settings import AlgorithmSettings, Budget, Solver


class OverTime(Exception):
    """A run has exceeded its time limit."""


class WatchedRun(Run):
    """A run without progress reports, and with an archive only for solvers, which read it.

    Raises OverTime after the batch in which `limit_s` seconds of wall time have passed.
    """

    def __init__(
        self, problem: ToleranceProblem, budget: Budget, seed: int, course: Course, solver: bool, limit_s: float | None
    ) -> None:
        super().__init__(problem, budget, seed, counts_generations=not solver)
        self.course = course
        self._archived = solver
        self._limit = limit_s
        self._cpu = time.thread_time()

    @property
    def generation(self) -> int:
        return self.course.batches

    def _values(self, x: Array) -> tuple[Array, Array]:
        return self.problem.searched(x)

    def _remember(self, x: Array, f: Array, violation: Array) -> None:
        if self._archived:
            self.archive.add(x, f, violation)
        self.course.add(f, violation <= 0.0, time.thread_time() - self._cpu)
        if self._limit is not None and self.seconds > self._limit:
            raise OverTime(f"time limit of {self._limit:g} s passed")


def watch(
    problem: ToleranceProblem,
    settings: AlgorithmSettings,
    budget: Budget,
    seed: int,
    course: Course,
    engine: str = "pymoo",
    limit_s: float | None = None,
) -> None:
    """Search as `search` does, with the same designs, and record them in `course`.

    Raises ModelError where every evaluation failed.
    """
    run = WatchedRun(problem, budget, seed, course, isinstance(settings, Solver), limit_s)
    drive(run, settings, seed, engine)
    if run.failures and run.failures == run.evaluations:
        where = dict(zip(problem.names, problem.complete(run.failed[:1])[0].tolist(), strict=True))
        raise ModelError(f"F or G is not finite at {where}, nor at any other of {run.failures} designs")
