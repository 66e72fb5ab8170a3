"""A search in progress: it evaluates, counts, records, and stops when the budget is used up."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from ..arrays import Array
from ..problems.tolerance_problem import ToleranceProblem
from .archive import Archive
from .attained import Attained
from .engine.survival import violation_of
from .settings import Budget
from .states import SavedState, State, joined, part


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


def values_of(problem: ToleranceProblem, x: Array) -> Values:
    """The values of search vectors, by pymoo's `_evaluate`, which a problem may have wrapped."""
    out: dict[str, Array] = {}
    problem._evaluate(x, out)
    return out["F"], out.get("G", np.empty((len(x), 0)))


class Run:
    """The problem, the budget, a generator, and `evaluate` for an algorithm.

    The budget of evaluations is honoured exactly. A budget of generations counts batches, and only
    with `counts_generations`. A batch is computed in parts of `grain` designs, as the problem's
    declaration states, or a few more, by the function `values` where it is given; the parts do not
    depend on that function.
    """

    def __init__(
        self,
        problem: ToleranceProblem,
        budget: Budget,
        seed: int,
        report: Callable[[Progress], None] | None = None,
        counts_generations: bool = False,
        values: Callable[[Sequence[Array]], Sequence[Values]] | None = None,
    ) -> None:
        self.problem = problem
        self.budget = budget
        self.rng = np.random.default_rng(seed)
        self.archive = Archive(problem.n_var, problem.n_obj)
        self.attained = Attained(problem.n_obj, cache(problem.box))
        self.chosen = np.empty((0, problem.n_var))
        self.evaluations = 0
        self.generations = budget.generations if counts_generations else None
        self._report = report
        self._shared = values
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

    def evaluate(self, x: Array) -> tuple[Array, Array]:
        """Objectives (n, objectives) and constraints (n, constraints) of search vectors.

        Raises BudgetSpent where the budget does not cover all of `x`; the rows that it covers are
        evaluated and recorded before.
        """
        if self.spent:
            raise BudgetSpent
        covered = x if self.evaluations_left is None else x[: self.evaluations_left]
        f, g = self._values(covered)
        self.evaluations += len(covered)
        self._remember(covered, f, violation_of(g))
        if len(covered) < len(x):
            raise BudgetSpent
        return f, g

    def _values(self, x: Array) -> Values:
        count = len(x) // self.problem.declaration.grain if self.problem.declaration.grain else 1
        if count < 2:
            return values_of(self.problem, x)
        parts = np.array_split(x, count)
        if self._shared is None:
            values: Sequence[Values] = [values_of(self.problem, part) for part in parts]
        else:
            values = self._shared(parts)
        return np.concatenate([f for f, _ in values]), np.concatenate([g for _, g in values])

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

    def choose(self, x: Array) -> None:
        """Add search vectors (n, variables) to those that the algorithm returns as its result."""
        self.chosen = np.vstack([self.chosen, x])

    def phase(self, name: str, share: float | None = None) -> None:
        """State the present phase of the work, and the fraction of the whole that is done."""
        self._phase = name, share

    def _remaining(self, at: int) -> float | None:
        """Remaining seconds after the batch `at`, by the budget that will be used up first."""
        evaluations, seconds, _, _, done = self._rows[at]
        estimates = []
        if self.generations is not None:
            estimates.append(seconds * (self.generations / (at + 1) - 1.0))
        if self.budget.evaluations is not None:
            estimates.append(seconds * (self.budget.evaluations / max(1, evaluations) - 1.0))
        if self.budget.time_limit_s is not None:
            estimates.append(self.budget.time_limit_s - seconds)
        if done:
            estimates.append(seconds * (1.0 / done - 1.0))
        return max(0.0, min(estimates)) if estimates else None

    def state(self) -> State:
        """Counts, history and archive as arrays."""
        table = [(p.generation, p.evaluations, p.seconds, p.hypervolume, p.feasible_fraction) for p in self.history]
        arrays = {
            "history": np.array(table, dtype=float).reshape(-1, 5),
            "counts": np.array([self.evaluations, self.seconds]),
        }
        return arrays | joined(archive=self.archive.state(), attained=self.attained.state())

    def restore(self, state: SavedState) -> None:
        """Continue from a `state()`, with the clock at its seconds."""
        self._rows = [(int(n), s, fraction, "", None) for _, n, s, _, fraction in state["history"].tolist()]
        evaluations, seconds = state["counts"].tolist()
        self.evaluations = int(evaluations)
        self._start = time.monotonic() - seconds
        self.archive.restore(part(state, "archive."))
        self.attained.restore(part(state, "attained."))
