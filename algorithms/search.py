"""The search loop over any algorithm, with a bounded archive of the best designs.

The loop of pymoo exceeds an evaluation budget and loses designs that leave the population; this one
evaluates exactly as many designs as the budget allows, and archives the best. It can be saved between
two generations, and continues to the same result.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from ..arrays import Array
from ..journal import unrecorded
from ..problems.tolerance_problem import ToleranceProblem
from .drivers import Driver, Unsavable, driver
from .exact.finish import finished, secured
from .run import BudgetSpent, Progress, Run, Values
from .settings import AlgorithmSettings, Budget, Solver
from .states import SavedState, State, joined, part

__all__ = ["Keeper", "Progress", "SearchResult", "State", "search"]


@dataclass(frozen=True, slots=True)
class SearchResult:
    """The result of a search: designs and objectives of the archive (all feasible), and its history.

    `miss` is the least violating design (one row, none where nothing was evaluated). `chosen` are
    the designs that the algorithm itself returns as its result, none where that is the archive.
    `failures` evaluations had a value that is not finite; `failed` are their designs, the first ones.
    """

    x: Array
    f: Array
    miss: Array
    evaluations: int
    history: tuple[Progress, ...]
    interrupted: bool
    chosen: Array
    failed: Array
    failures: int


class Keeper(Protocol):
    """Saves the state of a search, so that it can continue after an interruption."""

    def due(self) -> bool:
        """Whether it is time to save."""
        ...

    def save(self, state: State) -> None:
        """Save a state in place of the one before."""
        ...

    def saved(self) -> SavedState | None:
        """The state to continue from, None for a start from the beginning."""
        ...

    def cannot_save(self) -> None:
        """Called when the algorithm's state cannot be saved: a later search starts from the beginning."""
        ...


def search(
    problem: ToleranceProblem,
    settings: AlgorithmSettings,
    budget: Budget,
    seed: int,
    report: Callable[[Progress], None] | None = None,
    engine: str = "pymoo",
    keeper: Keeper | None = None,
    values: Callable[[Sequence[Array]], Sequence[Values]] | None = None,
) -> SearchResult:
    """Search until the budget is used up; an interrupt ends it with the result so far.

    `seed` is any integer >= 0. The result depends on problem, settings, evaluation or generation
    budget, seed and `engine` ("pymoo" or "array") alone: neither on interruptions, nor on the
    function `values` that computes the parts of a batch, where it is given. A `Solver` starts from
    its beginning after an interruption and takes no budget of generations.
    """
    solver = isinstance(settings, Solver)
    run = Run(problem, budget, seed, report, counts_generations=not solver, values=values)
    interrupted = False
    try:
        drive(run, settings, seed, engine, keeper)
    except KeyboardInterrupt:
        interrupted = True
    x, f = run.archive.arrays()
    chosen = run.chosen[:0] if interrupted else run.chosen
    more = interrupted, chosen, run.failed, run.failures
    return SearchResult(x, f, run.archive.miss, run.evaluations, run.history, *more)


def drive(run: Run, settings: AlgorithmSettings, seed: int, engine: str, keeper: Keeper | None = None) -> None:
    """Run the algorithm that `settings` describe, which evaluates by `run` until its budget is used up."""
    problem = run.problem
    try:
        if isinstance(settings, Solver):
            settings.solve(run)
        else:
            with unrecorded():  # its state is saved instead
                _evolve(run, lambda: driver(run.problem, settings, seed, engine), keeper)
    except BudgetSpent:
        pass
    run.problem = problem
    polish = bool(getattr(settings, "polish", False)) and not isinstance(settings, Solver)
    if (run.problem.declaration.sampled and not len(run.chosen)) or polish:
        finished(run, polish)
    elif run.problem.limits:
        secured(run)


def _evolve(run: Run, fresh: Callable[[], Driver], keeper: Keeper | None) -> None:
    """Evaluate generation after generation, until the budget is used up.

    A state is saved before a generation begins. Where the budget ends within a generation, a search
    with a larger budget continues from the state before it. The evaluations that were spared because
    designs of whole numbers came again are used for all designs that remain, where they suffice.
    """
    population, size = _begun(run, fresh, keeper), 0
    while not (run.spent or run.exhausted):
        remaining = run.evaluations_left
        if keeper is not None and (keeper.due() or (remaining is not None and remaining < 2 * size)):
            _save(keeper, run, population)
        x = population.ask()
        size = len(x)
        f, g = run.evaluate(x)
        if keeper is not None or not run.spent:
            population.tell(f, g)
    if keeper is not None:
        _save(keeper, run, population)
    run.complete()


def _begun(run: Run, fresh: Callable[[], Driver], keeper: Keeper | None) -> Driver:
    """The population search, from the saved state where there is one."""
    population = fresh()
    state = None if keeper is None else keeper.saved()
    if keeper is None or state is None:
        return population
    try:
        population.restore(part(state, "driver."))
    except Unsavable:
        keeper.cannot_save()
        return fresh()
    run.restore(part(state, "run."))
    return population


def _save(keeper: Keeper, run: Run, population: Driver) -> None:
    try:
        driven = population.state()
    except Unsavable:
        keeper.cannot_save()
        return
    keeper.save(joined(run=run.state(), driver=driven))
