"""A search in progress: it evaluates designs, counts and records them, and ends when its budget is spent;
problems whose free variables are all whole numbers evaluate no design twice.
"""

from __future__ import annotations

import itertools
import time
from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, Protocol, TypeVar

import numpy as np

from ..journal import recall_arrays, recording_suspended
from ..problems.tolerance_problem import ToleranceProblem
from ..section import Array, Flags, Integers
from .archive import Archive, Attained, SavedState, State, merge_states, part
from .engine import violation_of
from .settings import Budget

Key = tuple[int, ...]
TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")


class DiscreteDesigns:
    """Objectives (objectives,) and constraints (constraints,) of the designs evaluated so far."""

    def __init__(self, problem: ToleranceProblem) -> None:
        self._low, self._high = np.rint(problem.xl).astype(np.int64), np.rint(problem.xu).astype(np.int64)
        self._shape = problem.n_obj, problem.n_ieq_constr
        self._values: dict[Key, tuple[Array, Array]] = {}

    @staticmethod
    def of(problem: ToleranceProblem) -> DiscreteDesigns | None:
        """The designs of a problem, None where a free variable is not a whole number."""
        whole = bool(problem.free) and all(variable.integer for variable in problem.free)
        return DiscreteDesigns(problem) if whole else None

    @property
    def remaining(self) -> float:
        """The number of designs that have not been evaluated."""
        return float(np.prod(self._high - self._low + 1.0)) - len(self._values)

    def unknown(self, x: Array) -> Integers:
        """Rows of search vectors (n, variables) that have not been evaluated, each design once."""
        first: dict[Key, int] = {}
        for row, key in enumerate(_keys(x)):
            if key not in self._values:
                first.setdefault(key, row)
        return np.array(list(first.values()), dtype=np.int64)

    def learn(self, x: Array, f: Array, g: Array) -> None:
        """Remember objectives (n, objectives) and constraints (n, constraints)."""
        self._values.update(zip(_keys(x), zip(f, g, strict=True), strict=True))

    def values(self, x: Array) -> tuple[Array, Array]:
        """Objectives (n, objectives) and constraints (n, constraints) of evaluated designs."""
        rows = [self._values[key] for key in _keys(x)]
        f, g = (np.array([row[at] for row in rows]).reshape(len(rows), self._shape[at]) for at in range(2))
        return f, g

    def rest(self, most: int) -> Array:
        """Search vectors (n, variables) of at most so many designs that have not been evaluated."""
        ranges = (range(low, high + 1) for low, high in zip(self._low.tolist(), self._high.tolist(), strict=True))
        unknown = (key for key in itertools.product(*ranges) if key not in self._values)
        return np.array(list(itertools.islice(unknown, most)), dtype=float).reshape(-1, len(self._low))

    def state(self) -> State:
        """Everything as arrays."""
        x = np.array(list(self._values), dtype=float).reshape(-1, len(self._low))
        f, g = self.values(x)
        return {"x": x, "f": f, "g": g}

    def restore(self, state: SavedState) -> None:
        """Continue from a `state()`."""
        self._values = {}
        self.learn(state["x"], state["f"], state["g"])


def _keys(x: Array) -> list[Key]:
    return [tuple(row) for row in np.rint(x).astype(np.int64).tolist()]


# A search in progress: it evaluates, counts, records, and stops when the budget is used up.


class BudgetSpent(Exception):
    """The budget is used up; `search` then ends the search."""


@dataclass(frozen=True, slots=True)
class Progress:
    """State of a search after a generation, or after a batch of a solver.

    A solver states its `phase`, and the fraction of its work that is done as `share`.
    """

    generation: int
    generations: int | None
    evaluations: int
    evaluations_total: int | None
    seconds: float
    remaining: float | None
    hypervolume: float
    feasible_fraction: float
    phase: str = ""
    share: float | None = None


Row = tuple[int, float, float, str, float | None]
"""Evaluations, seconds, feasible fraction, phase and fraction done of a batch."""
Values = tuple[Array, Array]
"""Objectives (n, objectives) and constraints (n, constraints) of n designs."""
FAILED = 1e6
"""Violation of every limit by a design whose evaluation failed: more than by any other."""
EVEN = 0.25
"""Fraction by which the estimate of a whole may have changed since half of the time."""
LISTED = 1000
"""Designs whose evaluation failed that are listed at most; all of them are counted."""


class Shared(Protocol):
    """Computes a function of the problem and of each task, some of them in other processes."""

    def __call__(
        self, function: Callable[[ToleranceProblem, TaskT], ResultT], tasks: Sequence[TaskT], /
    ) -> Sequence[ResultT]: ...


def recalled_results(
    shared: Shared, function: Callable[[ToleranceProblem, TaskT], Any], tasks: Sequence[TaskT], inputs: Iterable[Any]
) -> Array:
    """The results (n, ...) of a few tasks, arrays or numbers, stored as one step; `inputs` are what they depend on."""
    return recall_arrays(inputs, lambda: (np.array(shared(function, tasks)),))[0]


def values_of(problem: ToleranceProblem, x: Array) -> Values:
    """The values of search vectors, by pymoo's `_evaluate`, which a problem may have wrapped."""
    out: dict[str, Array] = {}
    problem._evaluate(x, out, failing=True)
    return out["F"], out.get("G", np.empty((len(x), 0)))


def mark_failures_infeasible(f: Array, g: Array, box: Callable[[], tuple[Array, Array]]) -> tuple[Array, Array, Flags]:
    """Objectives and constraints in which failed evaluations are infeasible, and which rows (n,) failed.

    An evaluation has failed where a value is not finite. Its objectives become worse than the nadir
    of the problem's `box` and than all others of the batch, so that no algorithm prefers it.
    """
    failed: Flags = np.asarray(~(np.isfinite(f).all(axis=1) & np.isfinite(g).all(axis=1)))
    if not np.count_nonzero(failed):
        return f, g, failed
    ideal, nadir = box()
    worst = np.max(f[~failed], axis=0, initial=-np.inf)
    f, g = f.copy(), g.copy()
    f[failed], g[failed] = np.maximum(worst, nadir) + (nadir - ideal), FAILED
    return f, g, failed


def _box(problem: ToleranceProblem) -> tuple[Array, Array]:
    with recording_suspended():  # it is asked for at moments that differ
        return problem.box()


class Run:
    """The problem, the budget, a generator, and `evaluate` for an algorithm.

    The budget of evaluations is honoured exactly. A budget of generations counts batches, and only
    with `counts_generations`. A batch is computed in parts of `grain` designs, as the problem's
    declaration states, or a few more, by the function `shared` where it is given; the parts do not
    depend on that function. `start` are the search vectors (n, variables) to begin from; `begun` are
    their objectives and constraints, once a solver has them.
    """

    def __init__(
        self,
        problem: ToleranceProblem,
        budget: Budget,
        seed: int,
        report: Callable[[Progress], None] | None = None,
        counts_generations: bool = False,
        shared: Shared | None = None,
        start: Array | None = None,
    ) -> None:
        self.problem = self._asked = problem
        self.budget = budget
        self.rng = np.random.default_rng(seed)
        self.archive = Archive(problem.n_var, problem.n_obj)
        self.start = np.empty((0, problem.n_var)) if start is None else start
        self.begun: Values = np.empty((0, problem.n_obj)), np.empty((0, problem.n_ieq_constr))
        self._box = cache(partial(_box, problem))
        self.attained = Attained(problem.n_obj, self._box)
        self.chosen = np.empty((0, problem.n_var))
        self.failed = np.empty((0, problem.n_var))
        self.failures = 0
        self.discrete = DiscreteDesigns.of(problem)
        self.evaluations = self.asked = 0
        self.generations = budget.generations if counts_generations else None
        self._report = report
        self._shared = shared
        self._phase: tuple[str, float | None] = ("", None)
        self._start = time.monotonic()
        self._rows: list[Row] = []

    @property
    def generation(self) -> int:
        """Batches evaluated so far."""
        return len(self._rows)

    @property
    def history(self) -> tuple[Progress, ...]:
        """The state after each batch so far."""
        return tuple(map(self._progress, range(len(self._rows)), self.attained.values()))

    @property
    def seconds(self) -> float:
        """Time used, including that before an interruption."""
        return time.monotonic() - self._start

    @property
    def evaluations_left(self) -> int | None:
        """The remaining budget of evaluations, None where there is none."""
        total = self.budget.evaluations
        return None if total is None else total - self.evaluations

    @property
    def spent(self) -> bool:
        """Whether the budget is used up."""
        remaining, limit = self.evaluations_left, self.budget.time_limit_s
        return (
            (remaining is not None and remaining <= 0)
            or (self.generations is not None and self.generation >= self.generations)
            or (limit is not None and self.seconds >= limit)
        )

    @property
    def exhausted(self) -> bool:
        """Whether every design that exists has been evaluated."""
        return self.discrete is not None and self.discrete.remaining <= 0.0

    def complete(self) -> None:
        """Evaluate all designs of whole numbers that remain, where the evaluations suffice that were
        spared because designs came again.
        """
        if self.discrete is None or self.budget.time_limit_s is not None:
            return
        if 0.0 < self.discrete.remaining <= self.asked - self.evaluations:
            self.phase("designs that remain")
            x = self.discrete.rest(int(self.discrete.remaining))
            f, g = self._evaluated(x)
            self.discrete.learn(x, f, g)

    def evaluate(self, x: Array) -> tuple[Array, Array]:
        """Objectives (n, objectives) and constraints (n, constraints) of search vectors.

        Designs of whole numbers alone are evaluated, and counted, once. Raises BudgetSpent where the
        budget does not cover all of `x`; the rows that it covers are evaluated and recorded before.
        """
        if self.spent:
            raise BudgetSpent
        self.asked += len(x)
        if self.discrete is None:
            return self._evaluated(x)
        new = x[self.discrete.unknown(x)]
        left = len(new) if self.evaluations_left is None else self.evaluations_left
        f, g = self._evaluated(new[:left])
        self.discrete.learn(new[:left], f, g)
        if left < len(new):
            raise BudgetSpent
        return self.discrete.values(x)

    def _evaluated(self, x: Array) -> Values:
        covered = x if self.evaluations_left is None else x[: self.evaluations_left]
        shape = self.problem.n_obj, self.problem.n_ieq_constr
        f, g = self._values(covered) if len(covered) else (np.empty((0, shape[0])), np.empty((0, shape[1])))
        f, g, failed = mark_failures_infeasible(f, g, self._box)
        self.evaluations += len(covered)
        violation = violation_of(g)
        if np.count_nonzero(failed):
            violation[failed] = np.inf
            self.failures += int(np.count_nonzero(failed))
            self.failed = np.concatenate([self.failed, covered[failed]])[:LISTED]
        self._remember(covered, f, violation)
        if len(covered) < len(x):
            raise BudgetSpent
        return f, g

    def _values(self, x: Array) -> Values:
        """Values of a batch, with the clock at its end; recalled where this search is repeated."""
        f, g, end = recall_arrays((x,), lambda: (*self._computed(x), np.array(self.seconds)))
        self._start = min(self._start, time.monotonic() - float(end))
        return f, g

    def _computed(self, x: Array) -> Values:
        count = len(x) // self.problem.declaration.grain if self.problem.declaration.grain else 1
        if count < 2:
            return values_of(self.problem, x)
        parts = np.array_split(x, count)
        values = self.results(values_of, parts)
        return np.concatenate([f for f, _ in values]), np.concatenate([g for _, g in values])

    def results(
        self, function: Callable[[ToleranceProblem, TaskT], ResultT], tasks: Sequence[TaskT]
    ) -> Sequence[ResultT]:
        """`function(problem, task)` of each task, in other processes as well where the search has some."""
        if self._shared is None or self.problem is not self._asked:
            return [function(self.problem, task) for task in tasks]
        return self._shared(function, tasks)

    def _remember(self, x: Array, f: Array, violation: Array) -> None:
        feasible = self.archive.add(x, f, violation)
        self.attained.add(feasible)
        feasible_fraction = len(feasible) / len(f) if len(f) else 0.0
        self._rows.append((self.evaluations, self.seconds, feasible_fraction, *self._phase))
        if self._report is not None:
            self._report(self._progress(len(self._rows) - 1, self.attained.values()[-1]))

    def _progress(self, at: int, value: float) -> Progress:
        """The state after the batch `at`, with its hypervolume."""
        evaluations, seconds, feasible_fraction, phase, done = self._rows[at]
        return Progress(
            at + 1,
            self.generations,
            evaluations,
            self.budget.evaluations,
            seconds,
            self._remaining(at),
            value,
            feasible_fraction,
            phase,
            done,
        )

    def pulse(self) -> None:
        """Report the present phase, where nothing has been evaluated since the last report."""
        if self._report is None:
            return
        row = self._rows[-1] if self._rows else (self.evaluations, 0.0, 0.0, "", None)
        self._rows.append((row[0], self.seconds, row[2], *self._phase))
        self._report(self._progress(len(self._rows) - 1, (self.attained.values() or [0.0])[-1]))
        del self._rows[-1]

    def choose(self, x: Array) -> None:
        """Add search vectors (n, variables) to those that the algorithm returns as its result."""
        self.chosen = np.vstack([self.chosen, x])

    def phase(self, name: str, share: float | None = None) -> None:
        """State the present phase of the work, and the fraction of the whole that is done."""
        self._phase = name, share

    def _remaining(self, at: int) -> float | None:
        """Remaining seconds after the batch `at`, by the budget that will be used up first.

        None where the work does not go on evenly: where the estimate at half the time was another.
        """
        seconds = self._rows[at][1]
        half = bisect_left(self._rows, 0.5 * seconds, hi=at, key=lambda row: row[1])
        total, before = self._total(at), self._total(half)
        if total is None or before is None or abs(total - before) > EVEN * total:
            return None
        return max(0.0, total - seconds)

    def _total(self, at: int) -> float | None:
        """Estimate of the seconds of the whole after the batch `at`; None where nothing is known."""
        evaluations, seconds, _, _, done = self._rows[at]
        estimates = []
        if self.generations is not None:
            estimates.append(seconds * self.generations / (at + 1))
        if self.budget.evaluations is not None:
            estimates.append(seconds * self.budget.evaluations / max(1, evaluations))
        if self.budget.time_limit_s is not None:
            estimates.append(self.budget.time_limit_s)
        if done:
            estimates.append(seconds / done)
        return min(estimates) if estimates else None

    def state(self) -> State:
        """Counts, history and archive as arrays."""
        table = [(p.generation, p.evaluations, p.seconds, p.hypervolume, p.feasible_fraction) for p in self.history]
        arrays = {
            "history": np.array(table, dtype=float).reshape(-1, 5),
            "counts": np.array([self.evaluations, self.seconds, self.failures, self.asked]),
            "failed": self.failed,
        }
        discrete = {} if self.discrete is None else self.discrete.state()
        return arrays | merge_states(archive=self.archive.state(), attained=self.attained.state(), discrete=discrete)

    def restore(self, state: SavedState) -> None:
        """Continue from a `state()`, with the clock at its seconds."""
        self._rows = [(int(n), s, fraction, "", None) for _, n, s, _, fraction in state["history"].tolist()]
        evaluations, seconds, failures, asked = state["counts"].tolist()
        self.evaluations, self.failures, self.asked = int(evaluations), int(failures), int(asked)
        self.failed = state["failed"]
        self._start = time.monotonic() - seconds
        self.archive.restore(part(state, "archive."))
        self.attained.restore(part(state, "attained."))
        if self.discrete is not None:
            self.discrete.restore(part(state, "discrete."))
