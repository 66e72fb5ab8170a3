"""The search loop over any pymoo algorithm, with an archive of all evaluated designs.

pymoo's own loop overshoots an evaluation budget and forgets what left the population; this one asks
and tells, evaluates exactly what the budget allows, and keeps everything.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.core.evaluator import Evaluator
from pymoo.core.termination import NoTermination

from ..problems.tolerance_problem import ToleranceProblem
from .indicators import hypervolume, nondominated
from .settings import AlgorithmSettings, Budget

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Progress:
    """State of a search after a generation."""

    generation: int
    generations: int | None
    evaluations: int
    evaluations_total: int | None
    seconds: float
    remaining: float | None
    hypervolume: float
    feasible_fraction: float


@dataclass(slots=True)
class Archive:
    """All evaluated designs: search vectors, objectives, constraint violations; and the front."""

    problem: ToleranceProblem
    batches: list[tuple[Array, Array, Array]] = field(default_factory=list)
    front: Array = field(init=False)
    size: int = 0

    def __post_init__(self) -> None:
        self.front = np.empty((0, self.problem.n_obj))

    def add(self, x: Array, f: Array, g: Array) -> None:
        """Keep a batch; the front of feasible objectives is updated."""
        self.batches.append((x, f, g))
        self.size += len(x)
        merged = np.vstack([self.front, f[np.all(g <= 0.0, axis=1)]])
        self.front = merged[nondominated(merged)] if len(merged) else merged

    def arrays(self) -> tuple[Array, Array, Array]:
        """X (n, variables), F (n, objectives) and G (n, constraints)."""
        n, m, k = self.problem.n_var, self.problem.n_obj, self.problem.n_ieq_constr
        batches = [(np.empty((0, n)), np.empty((0, m)), np.empty((0, k))), *self.batches]
        x, f, g = (np.vstack(parts) for parts in zip(*batches, strict=True))
        return x, f, g


@dataclass(frozen=True, slots=True)
class SearchResult:
    """What a search found: the archive's arrays, the course of the search, how it ended."""

    x: Array
    f: Array
    g: Array
    history: tuple[Progress, ...]
    interrupted: bool


def search(
    problem: ToleranceProblem,
    settings: AlgorithmSettings,
    budget: Budget,
    seed: int,
    report: Callable[[Progress], None] | None = None,
) -> SearchResult:
    """Search until the budget is used; an interrupt ends it with what has been found.

    `seed` is any integer >= 0. The result depends on problem, settings, evaluation or generation
    budget and seed alone.
    """
    archive, history, interrupted = Archive(problem), [], False
    box = problem.box()
    try:
        for state in _generations(problem, settings, budget, seed, archive, box):
            history.append(state)
            if report is not None:
                report(state)
    except KeyboardInterrupt:
        interrupted = True
    return SearchResult(*archive.arrays(), tuple(history), interrupted)


def _generations(
    problem: ToleranceProblem,
    settings: AlgorithmSettings,
    budget: Budget,
    seed: int,
    archive: Archive,
    box: tuple[Array, Array],
) -> Iterator[Progress]:
    algorithm = settings.build(problem)
    algorithm.setup(problem, seed=seed, termination=NoTermination())
    start, generation = time.monotonic(), 0
    while not _used_up(budget, generation, archive.size, time.monotonic() - start):
        asked = algorithm.ask()
        if budget.evaluations is not None:
            asked = asked[: budget.evaluations - archive.size]
        feasible = _evaluate(problem, asked, archive)
        generation += 1
        seconds = time.monotonic() - start
        yield Progress(
            generation,
            budget.generations,
            archive.size,
            budget.evaluations,
            seconds,
            _remaining(budget, generation, archive.size, seconds),
            hypervolume(archive.front, *box),
            feasible,
        )
        if not _used_up(budget, generation, archive.size, seconds):
            algorithm.tell(infills=asked)


def _evaluate(problem: ToleranceProblem, asked: Any, archive: Archive) -> float:
    """Evaluate a population into the archive; its feasible fraction."""
    Evaluator().eval(problem, asked)
    x, f = (np.asarray(asked.get(key), dtype=float) for key in ("X", "F"))
    g = np.asarray(asked.get("G"), dtype=float).reshape(len(x), problem.n_ieq_constr)
    archive.add(x, f, g)
    return float(np.mean(np.all(g <= 0.0, axis=1)))


def _used_up(budget: Budget, generation: int, evaluations: int, seconds: float) -> bool:
    return (
        (budget.generations is not None and generation >= budget.generations)
        or (budget.evaluations is not None and evaluations >= budget.evaluations)
        or (budget.time_limit_s is not None and seconds >= budget.time_limit_s)
    )


def _remaining(budget: Budget, generation: int, evaluations: int, seconds: float) -> float | None:
    """Seconds left, by the budget that will be used up first."""
    left = []
    if budget.generations is not None:
        left.append(seconds * (budget.generations / generation - 1.0))
    if budget.evaluations is not None:
        left.append(seconds * (budget.evaluations / max(1, evaluations) - 1.0))
    if budget.time_limit_s is not None:
        left.append(budget.time_limit_s - seconds)
    return max(0.0, min(left)) if left else None
