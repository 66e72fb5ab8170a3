"""The designs of a search, computed by other processes as well: the same bytes, nothing lost."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from multiprocessing import active_children
from typing import Any

import numpy as np
import pytest

from tolevo.algorithms.nsga2 import NSGA2
from tolevo.algorithms.run import Run, Values, values_of
from tolevo.algorithms.search import SearchResult, search
from tolevo.algorithms.settings import Budget
from tolevo.commands.run.front import Designs
from tolevo.errors import Fault, InputError
from tolevo.execution import Execution
from tolevo.problems.rv_backlash import RvBacklash
from tolevo.problems.rv_reducer import RvReducer
from tolevo.problems.settings import Settings
from tolevo.problems.tolerance_problem import ToleranceProblem
from tolevo.section import Array

BUDGET = Budget(generations=3)


@pytest.fixture(scope="module")
def problem() -> RvReducer:
    return RvReducer(Settings(parameters={"search_units": 24, "search_positions": 7}))


@pytest.fixture
def designs(problem: RvReducer) -> Iterator[Designs]:
    with Designs(problem, Execution(3), lambda: 2) as found:
        yield found


def batch(problem: RvReducer, count: int) -> list[Array]:
    share = np.random.default_rng(1).uniform(size=(count, problem.n_var))
    return np.array_split(problem.xl + share * (problem.xu - problem.xl), count // problem.declaration.grain)


def here(problem: RvReducer, parts: list[Array]) -> list[Values]:
    return [values_of(problem, part) for part in parts]


def same(one: list[Values], other: list[Values]) -> bool:
    pairs = zip(one, other, strict=True)
    return all(np.array_equal(a, b) for first, second in pairs
               for a, b in zip(first, second, strict=True))  # fmt: skip


def started(designs: Designs, parts: list[Array]) -> None:
    """Ask until two other processes take part."""
    until = time.monotonic() + 60.0
    while designs.helpers < 2:
        assert time.monotonic() < until
        designs.results(values_of, parts)
        time.sleep(0.05)  # what this process computes meanwhile is of no use


def searched(problem: RvReducer, designs: Designs | None) -> SearchResult:
    shared = None if designs is None else designs.results
    return search(problem, NSGA2(population=16), BUDGET, 5, shared=shared)


def test_processes_take_part_when_they_are_free_and_change_nothing(problem: RvReducer) -> None:
    """Neither the values of a batch nor a whole search."""
    free, parts = [0], batch(problem, 16)
    with Designs(problem, Execution(3), lambda: free[0]) as designs:
        before = {*active_children()}
        assert same(designs.results(values_of, parts), here(problem, parts))
        assert {*active_children()} == before
        free[0] = 2
        started(designs, parts)
        children = {*active_children()} - before
        assert len(children) == 2
        assert same(designs.results(values_of, parts), here(problem, parts))
        alone, shared = searched(problem, None), searched(problem, designs)
    assert alone.evaluations == shared.evaluations == 48
    for name in ("x", "f", "miss"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(shared, name))
    assert not any(child.is_alive() for child in children)


@pytest.mark.slow
def test_what_a_killed_process_had_is_computed_again(problem: RvReducer, designs: Designs) -> None:
    parts = batch(problem, 32)
    expected = here(problem, parts)
    started(designs, parts)
    for number, count in ((signal.SIGKILL, 2), (signal.SIGTERM, 1)):
        for child in active_children()[:count]:
            os.kill(child.pid or 0, number)
        assert same(designs.results(values_of, parts), expected)


def test_a_task_begins_ahead_in_the_process_that_takes_part_later(problem: RvReducer) -> None:
    """With one other process this is it; without waiting, a value stands for what has not ended."""
    parts = batch(problem, 8)
    expected = here(problem, parts)
    with Designs(problem, Execution(2), lambda: 1) as designs:
        before = {*active_children()}
        later = designs.ahead(values_of, parts[0])
        assert len(later(())) == 0
        assert same(designs.results(values_of, parts), expected)
        assert same([later()], expected)
        begun = {*active_children()} - before
        assert same(designs.results(values_of, parts), expected)
        assert same([later(())], expected)
        assert designs.helpers == 1
        assert {*active_children()} - before == begun
        assert len(begun) == 1


def _refused(_: ToleranceProblem, task: int) -> None:
    raise InputError([Fault("problem", str(task))])


def test_an_error_in_a_task_ahead_is_raised_without_waiting(problem: RvReducer) -> None:
    with Designs(problem, Execution(2), lambda: 1) as designs:
        later = designs.ahead(_refused, 7)
        until = time.monotonic() + 60.0
        while designs.executor is None:
            assert time.monotonic() < until
            time.sleep(0.01)
        with pytest.raises(InputError, match="7"):
            later(None)


def test_a_batch_of_cheap_designs_is_computed_at_once() -> None:
    """No grain: pymoo's batch is the problem's."""
    cheap, seen = RvBacklash(), list[object]()

    def never(function: object, parts: object) -> list[Any]:
        seen.append(parts)
        return []

    run = Run(cheap, Budget(), 0, shared=never)
    f, _ = run.evaluate(np.tile(cheap.xu, (50, 1)))
    assert (len(f), seen) == (50, [])
