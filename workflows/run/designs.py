"""The designs of the main search, evaluated by an executor as well where workers are free."""

from __future__ import annotations

import pickle
import secrets
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version

from ...algorithms.run import Values, values_of
from ...arrays import Array
from ...problems.tolerance_problem import ToleranceProblem
from ..execution import (
    Background,
    Closing,
    Execution,
    Executor,
    Lost,
    Processes,
    built,
    check_version,
    executor_of,
    next_of,
    pinned,
)


@dataclass(frozen=True, slots=True)
class Part:
    """A task: search vectors (n, variables) of a batch, its part `at`, and the pickled problem."""

    key: str
    version: str
    problem: bytes
    at: int
    x: Array


def computed(task: Part) -> Values:
    """Objectives and constraints of a part."""
    check_version(task.version)
    with pinned():
        return values_of(built(task.problem), task.x)


class Designs(Closing):
    """Shares the parts of a batch with other processes; this one computes what none has begun.

    `free` returns how many processes are available in addition to this one; more are started when
    the number rises, and are used once they have computed a task. They end when the context is
    left.
    """

    def __init__(self, problem: ToleranceProblem, where: Execution, free: Callable[[], int]) -> None:
        self.problem, self._where, self._free = problem, where, free
        self._name = secrets.token_hex(8)
        self._content = b""
        self._batches = 0
        self._executor: Executor | None = None
        self._starting: tuple[Processes, Background[Part, Values]] | None = None

    def close(self) -> None:
        """End all other processes."""
        if self._starting is not None:
            self._starting[1].close()
        if self._executor is not None:
            self._executor.close()

    @property
    def helpers(self) -> int:
        """Processes, or workers of a scheduler, that take part in addition to this process."""
        return 0 if self._executor is None else self._executor.workers

    def values(self, parts: Sequence[Array]) -> list[Values]:
        """Objectives and constraints of each part; the part of a lost worker is computed here."""
        self._batches += 1
        self._start(parts[0])
        if self._executor is None:
            return [values_of(self.problem, part) for part in parts]
        tasks = deque(self._tasks(parts))
        results: dict[int, Values] = {}
        background = Background(self._executor, computed, partial(next_of, tasks))
        while (task := next_of(tasks)) is not None:
            results[task.at] = values_of(self.problem, task.x)
        background.wait()
        while pairs := background.taken():
            for task, result in pairs:
                if isinstance(result, Lost):
                    results[task.at] = values_of(self.problem, task.x)
                else:
                    results[task.at] = result
        return [results[at] for at in range(len(parts))]

    def _tasks(self, parts: Sequence[Array]) -> list[Part]:
        if not self._content:
            self._content = pickle.dumps(self.problem)
        name = f"{self._name}-{self._batches}"
        return [Part(f"{name}-{at}", version("tolevo"), self._content, at, x) for at, x in enumerate(parts)]

    def _start(self, part: Array) -> None:
        """Start processes where some are free, and take those that have started."""
        if self._where.dask:
            self._executor = self._executor or executor_of(self._where)
            return
        if self._starting is not None and self._starting[1].over:
            begun, first = self._starting
            first.taken()
            if self._executor is not None:
                self._executor.close()
            self._executor, self._starting = begun, None
        if self._starting is None and (free := self._free()) > self.helpers:
            processes, tasks = Processes(free), deque(self._tasks([part] * free))
            self._starting = processes, Background(processes, computed, partial(next_of, tasks))
