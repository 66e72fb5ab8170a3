"""The search loop over any algorithm, with a bounded archive of the best designs.

The loop of pymoo exceeds an evaluation budget and loses designs that leave the population; this one
evaluates exactly as many designs as the budget allows, and archives the best. It can be saved between
two generations, and continues to the same result.
"""

from __future__ import annotations

import json
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from pymoo.core.population import Population
from pymoo.core.termination import NoTermination

from ..errors import ModelError
from ..journal import recording_suspended
from ..problems.tolerance_problem import ToleranceProblem
from ..section import Array, Integers
from .archive import Course, SavedState, State, merge_states, nondominated, part, without_rounding
from .engine import Space, violation_of
from .exact.epsilon import finish_front, replace_violating_points
from .run import BudgetSpent, Progress, Run, Shared
from .settings import AlgorithmSettings, Budget, Solver

# One interface to all population searches: ask for designs, tell their values, save and resume.


VALUES = ("X", "F", "G", "H")


class Unsavable(Exception):
    """The state of an algorithm does not consist of arrays and numbers."""


class Driver(ABC):
    """A population search in progress."""

    @abstractmethod
    def ask(self) -> Array:
        """Designs (n, variables) to be evaluated."""

    @abstractmethod
    def begin_with(self, x: Array) -> Array:
        """Replace the first of the designs that are asked for by `x`; all designs (n, variables) that
        are asked for after that.
        """

    @abstractmethod
    def tell(self, f: Array, g: Array) -> None:
        """Take in objectives and constraints of all designs that were asked for."""

    @abstractmethod
    def state(self) -> State:
        """Everything that the next `ask` depends on. Raises Unsavable."""

    @abstractmethod
    def restore(self, state: SavedState) -> None:
        """Continue from a `state()`. Raises Unsavable where it does not fit."""


def driver(problem: ToleranceProblem, settings: AlgorithmSettings, seed: int, engine: str) -> Driver:
    """The search that `settings` describe, by the engine "array" or "pymoo"."""
    if engine == "array":
        return ArrayDriver(problem, settings, seed)
    return PymooDriver(problem, settings, seed)


class ArrayDriver(Driver):
    """A search by an array engine."""

    def __init__(self, problem: ToleranceProblem, settings: AlgorithmSettings, seed: int) -> None:
        self.engine = settings.engine(Space.of(problem), np.random.default_rng(seed))
        self.asked = np.empty((0, problem.n_var))

    def ask(self) -> Array:
        self.asked = self.engine.ask()
        return self.asked

    def begin_with(self, x: Array) -> Array:
        self.asked = np.concatenate([x, self.asked[len(x) :]])
        return self.asked

    def tell(self, f: Array, g: Array) -> None:
        self.engine.tell(self.asked, f, g)

    def state(self) -> State:
        return self.engine.state()

    def restore(self, state: SavedState) -> None:
        self.engine.restore(state)


class PymooDriver(Driver):
    """A search by a pymoo algorithm.

    Its state is the population and the optimum with all that is stored with each individual, the
    generator, and the attributes that the settings name in `state`.
    """

    def __init__(self, problem: ToleranceProblem, settings: AlgorithmSettings, seed: int) -> None:
        self.names = settings.state
        self.algorithm = settings.build(problem)
        self.algorithm.setup(problem, seed=seed, termination=NoTermination())
        self.asked = Population.empty()

    def ask(self) -> Array:
        self.asked = self.algorithm.ask()
        return np.asarray(self.asked.get("X"), dtype=float)

    def begin_with(self, x: Array) -> Array:
        self.asked[: len(x)].set("X", x)
        return np.asarray(self.asked.get("X"), dtype=float)

    def tell(self, f: Array, g: Array) -> None:
        self.asked.set("F", without_rounding(f), "G", without_rounding(g), "H", np.zeros((len(f), 0)))
        self.asked.apply(lambda individual: individual.evaluated.update(("F", "G", "H")))
        self.algorithm.tell(infills=self.asked)

    def state(self) -> State:
        algorithm = self.algorithm
        saved: State = {"begun": np.array(algorithm.is_initialized)}
        saved["rng"] = np.array(json.dumps(algorithm.random_state.bit_generator.state))
        if not algorithm.is_initialized:
            return saved
        saved["iteration"] = np.array(algorithm.n_iter)
        population, optimum = list(algorithm.pop), list(() if algorithm.opt is None else algorithm.opt)
        everyone = list({id(individual): individual for individual in (*population, *optimum)}.values())
        place = {id(individual): at for at, individual in enumerate(everyone)}
        saved["population"] = np.array([place[id(individual)] for individual in population], dtype=np.int64)
        saved["optimum"] = np.array([place[id(individual)] for individual in optimum], dtype=np.int64)
        for key in VALUES:
            saved[key] = _numeric_array([getattr(individual, key) for individual in everyone])
        for key in sorted({key for individual in everyone for key in individual.data}):
            known = np.array([individual.data.get(key) is not None for individual in everyone])
            values = [individual.data[key] for individual, has in zip(everyone, known, strict=True) if has]
            saved[f"has.{key}"], saved[f"data.{key}"] = known, _numeric_array(values)
        for name in self.names:
            value = _attribute(algorithm, name)
            saved[f"set.{name}"] = np.array(value is not None)
            if value is not None:
                saved[f"attribute.{name}"] = _numeric_array(value)
        return saved

    def restore(self, state: SavedState) -> None:
        algorithm = self.algorithm
        if bool(state["begun"]):
            everyone = Population.new(**{key: state[key] for key in VALUES})
            for individual in everyone:
                individual.evaluated.update(("F", "G", "H"))
            _restore_data(everyone, state)
            algorithm._initialize()
            algorithm.pop = everyone[state["population"]]
            algorithm.opt = everyone[state["optimum"]]
            algorithm.n_iter = int(state["iteration"])
            algorithm.is_initialized = True
            for name in self.names:
                self._set(name, state)
        algorithm.random_state.bit_generator.state = json.loads(str(state["rng"]))

    def _set(self, name: str, state: SavedState) -> None:
        if f"set.{name}" not in state:
            raise Unsavable(name)
        owner, _, last = name.rpartition(".")
        value = state[f"attribute.{name}"] if bool(state[f"set.{name}"]) else None
        target = _attribute(self.algorithm, owner) if owner else self.algorithm
        setattr(target, last, value.item() if value is not None and not value.shape else value)


def _numeric_array(value: Any) -> NDArray[Any]:
    """The value as an array of numbers. Raises Unsavable where it cannot be one."""
    try:
        array = np.array(value)
    except ValueError as error:  # ragged
        raise Unsavable(str(error)) from error
    if array.dtype.kind not in "biuf":
        raise Unsavable(f"{array.dtype} is not numeric")
    return array


def _attribute(owner: Any, name: str) -> Any:
    """A dotted attribute. Raises Unsavable where there is none."""
    try:
        return attrgetter(name)(owner)
    except AttributeError as error:
        raise Unsavable(str(error)) from error


def _restore_data(everyone: Any, state: SavedState) -> None:
    """Restore the data that are stored with every individual."""
    for key in state:
        if key.startswith("data."):
            name = key.removeprefix("data.")
            rows = np.flatnonzero(state[f"has.{name}"])
            for row, value in zip(rows, state[key], strict=True):
                everyone[row].data[name] = value


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
    shared: Shared | None = None,
    start: Array | None = None,
) -> SearchResult:
    """Search until the budget is used up; an interrupt ends it with the result so far.

    `seed` is any integer >= 0. The result depends on problem, settings, evaluation or generation
    budget, seed and `engine` ("pymoo" or "array") alone: neither on interruptions, nor on the
    function `shared` that computes parts of the work, where it is given. A `Solver` starts from
    its beginning after an interruption and takes no budget of generations. The search vectors `start`
    (n, variables) are evaluated first; the first generation, or the solver, begins from the best of them.
    """
    solver = isinstance(settings, Solver)
    run = Run(problem, budget, seed, report, counts_generations=not solver, shared=shared, start=start)
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
            _solve(run, settings)
        else:
            with recording_suspended():  # its state is saved instead
                _evolve(run, lambda: driver(run.problem, settings, seed, engine), keeper)
    except BudgetSpent:
        pass
    run.problem = problem
    polish = bool(getattr(settings, "polish", False)) and not isinstance(settings, Solver)
    if (run.problem.declaration.sampled and not len(run.chosen)) or polish:
        finish_front(run, polish, getattr(settings, "restarts", True), getattr(settings, "descends", False))
    elif run.problem.limits:
        replace_violating_points(run)


def _solve(run: Run, settings: Solver) -> None:
    """Run a solver, whose result the designs that the run starts from join."""
    if len(run.start):
        run.phase("start")
        run.begun = run.evaluate(run.start)
    settings.solve(run)
    if len(run.chosen):
        run.choose(run.start)


def _evolve(run: Run, fresh: Callable[[], Driver], keeper: Keeper | None) -> None:
    """Evaluate generation after generation, until the budget is used up.

    A state is saved before a generation begins. Where the budget ends within a generation, a search
    with a larger budget continues from the state before it. The evaluations that were spared because
    designs of whole numbers came again are used for all designs that remain, where they suffice.
    """
    population, size = _start_or_resume(run, fresh, keeper), 0
    if len(run.start) and not run.generation and not run.spent:
        _begin(run, population)
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


def _begin(run: Run, population: Driver) -> None:
    """The first generation of a run with designs to start from: all of these are evaluated, and the
    best take the places of designs that would be drawn.
    """
    drawn = population.ask()
    kept, given = min(len(run.start), len(drawn)), len(run.start)
    f, g = run.evaluate(np.concatenate([run.start, drawn[kept:]]))
    best = best_rows(f[:given], g[:given], kept)
    population.begin_with(run.start[best])
    rows = np.concatenate([best, np.arange(given, len(f))])
    population.tell(f[rows], g[rows])


def best_rows(f: Array, g: Array, count: int) -> Integers:
    """The best `count` rows of objectives (n, objectives) and constraints (n, constraints).

    The feasible ones that no other dominates, evenly along the first objective where they are more;
    then the feasible ones, then those that violate least.
    """
    violation = violation_of(g)
    kept = np.flatnonzero(violation <= 0.0)
    first = kept[nondominated(f[kept])] if len(kept) else kept
    first = first[np.lexsort(f[first].T[::-1])]
    if len(first) > count:
        return np.asarray(first[np.unique(np.linspace(0, len(first) - 1, count).round().astype(np.int64))])
    others = np.setdiff1d(np.arange(len(f)), first)
    order = others[np.lexsort((*f[others].T[::-1], np.maximum(violation[others], 0.0)))]
    return np.asarray(np.concatenate([first, order])[:count], dtype=np.int64)


def _start_or_resume(run: Run, fresh: Callable[[], Driver], keeper: Keeper | None) -> Driver:
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
    keeper.save(merge_states(run=run.state(), driver=driven))


# A search that records its course alone, as one of the many runs of a study.


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
