"""A search under way: it evaluates, counts, remembers, and stops when the budget is used."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..problems.tolerance_problem import ToleranceProblem
from .archive import Archive
from .engine.survival import violation_of
from .indicators import area, hypervolume
from .settings import Budget

Array = NDArray[np.float64]
State = dict[str, NDArray[Any]]


class BudgetSpent(Exception):
    """The budget is used up; `search` ends the search where this is raised."""


@dataclass(frozen=True, slots=True)
class Progress:
    """State of a search after a generation, or after a batch of a solver.

    `phase` and `share` are what a solver says of itself: what it does, and how much is done.
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


class Run:
    """What an algorithm works with: the problem, the budget, a generator, and `evaluate`.

    The budget of evaluations is honoured exactly. A budget of generations counts batches, and only
    where `counts_generations` says so.
    """

    def __init__(
        self,
        problem: ToleranceProblem,
        budget: Budget,
        seed: int,
        report: Callable[[Progress], None] | None = None,
        counts_generations: bool = False,
    ) -> None:
        self.problem = problem
        self.budget = budget
        self.rng = np.random.default_rng(seed)
        self.archive = Archive(problem.n_var, problem.n_obj)
        self.history: list[Progress] = []
        self.chosen = np.empty((0, problem.n_var))
        self.evaluations = 0
        self.generations = budget.generations if counts_generations else None
        self._report = report
        self._phase: tuple[str, float | None] = ("", None)
        self._start = time.monotonic()
        self._seen = 0
        self._hypervolume = 0.0

    @cached_property
    def _box(self) -> tuple[Array, Array]:
        return self.problem.box()

    @property
    def generation(self) -> int:
        """Batches evaluated so far."""
        return len(self.history)

    @property
    def seconds(self) -> float:
        """Time used, that before an interruption included."""
        return time.monotonic() - self._start

    @property
    def evaluations_left(self) -> int | None:
        """What is left of the budget of evaluations, None where there is none."""
        total = self.budget.evaluations
        return None if total is None else total - self.evaluations

    @property
    def spent(self) -> bool:
        """Whether the budget is used up."""
        left, limit = self.evaluations_left, self.budget.time_limit_s
        return (
            (left is not None and left <= 0)
            or (self.generations is not None and self.generation >= self.generations)
            or (limit is not None and self.seconds >= limit)
        )

    def evaluate(self, x: Array) -> tuple[Array, Array]:
        """Objectives (n, objectives) and constraints (n, constraints) of search vectors.

        Raises BudgetSpent where the budget does not cover all of `x`; the rows that it covers are
        evaluated and remembered before.
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

    def _values(self, x: Array) -> tuple[Array, Array]:
        """Objectives and constraints, by pymoo's way, so that pymoo problems may be wrapped."""
        out = self.problem.evaluate(x, return_values_of=["F", "G"], return_as_dictionary=True)
        f = np.asarray(out["F"], dtype=float)
        return f, np.asarray(out["G"], dtype=float).reshape(len(x), self.problem.n_ieq_constr)

    def _remember(self, x: Array, f: Array, violation: Array) -> None:
        feasible = self.archive.add(x, f, violation)
        self._note(float(feasible.mean()) if len(feasible) else 0.0)

    def choose(self, x: Array) -> None:
        """Add search vectors (n, variables) to those that the algorithm gives as its result."""
        self.chosen = np.vstack([self.chosen, x])

    def phase(self, name: str, share: float | None = None) -> None:
        """Say what is being done, and the share of the whole that is done."""
        self._phase = name, share

    def _note(self, feasible_fraction: float) -> None:
        if self.archive.changes != self._seen:
            self._seen = self.archive.changes
            measure = area if self.problem.n_obj == 2 else hypervolume
            self._hypervolume = measure(self.archive.front, *self._box)
        state = Progress(
            self.generation + 1,
            self.generations,
            self.evaluations,
            self.budget.evaluations,
            self.seconds,
            self._remaining(),
            self._hypervolume,
            feasible_fraction,
            *self._phase,
        )
        self.history.append(state)
        if self._report is not None:
            self._report(state)

    def _remaining(self) -> float | None:
        """Seconds left, by the budget that will be used up first."""
        seconds, left = self.seconds, []
        if self.generations is not None:
            left.append(seconds * (self.generations / (self.generation + 1) - 1.0))
        if self.budget.evaluations is not None:
            left.append(seconds * (self.budget.evaluations / max(1, self.evaluations) - 1.0))
        if self.budget.time_limit_s is not None:
            left.append(self.budget.time_limit_s - seconds)
        if self._phase[1]:
            left.append(seconds * (1.0 / self._phase[1] - 1.0))
        return max(0.0, min(left)) if left else None

    def state(self) -> State:
        """Counts, history and archive as arrays."""
        table = [
            (p.generation, p.evaluations, p.seconds, p.hypervolume, p.feasible_fraction)
            for p in self.history
        ]
        own = {
            "history": np.array(table, dtype=float).reshape(-1, 5),
            "counts": np.array([self.evaluations, self._seen, self._hypervolume, self.seconds]),
        }
        return own | {f"archive.{key}": value for key, value in self.archive.state().items()}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from a `state()`; the clock goes on from its seconds."""
        total = self.budget.evaluations
        self.history = [
            Progress(int(g), self.generations, int(n), total, s, None, h, share)
            for g, n, s, h, share in state["history"].tolist()
        ]
        evaluations, seen, self._hypervolume, seconds = state["counts"].tolist()
        self.evaluations, self._seen = int(evaluations), int(seen)
        self._start = time.monotonic() - seconds
        prefix = "archive."
        self.archive.restore(
            {key[len(prefix):]: value for key, value in state.items() if key.startswith(prefix)}
        )  # fmt: skip
