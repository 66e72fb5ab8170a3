"""The side searches of a run, by an executor during the main search where there are workers."""

from __future__ import annotations

import secrets
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import pandas as pd

from ...algorithms.checkpoint import Checkpoint
from ...algorithms.search import Progress
from ...journal import recorded
from ..execution import Background, Closing, Execution, Lost, Processes, executor_of, next_of
from .references import SideSearch

Fronts = dict[SideSearch, pd.DataFrame | None]


@dataclass(frozen=True, slots=True)
class SideTask:
    """A side search as a task."""

    key: str
    side: SideSearch


def front_of(task: SideTask) -> pd.DataFrame | None:
    """The reported front of a side search."""
    return task.side.front()


class Sides(Closing):
    """Runs side searches during the main one; each finished front is kept in the checkpoint.

    One of the `workers` is the process of the main search, which then computes the fronts
    that no other has begun. Searches that still run when the context is left are ended at once.
    """

    def __init__(
        self,
        searches: tuple[SideSearch, ...],
        workers: Execution | int,
        checkpoint: Checkpoint,
        progress: Callable[[Progress], None] | None = None,
    ) -> None:
        self.searches, self._progress = searches, progress
        self.checkpoint = checkpoint
        checkpoint.keep_only([side.key for side in searches])
        name = secrets.token_hex(8)
        self._open = deque(
            SideTask(f"{name}-{at}", side) for at, side in enumerate(searches) if side.key not in checkpoint.tables
        )
        self._background: Background[SideTask, pd.DataFrame | None] | None = None
        self.where = workers if isinstance(workers, Execution) else Execution(workers)
        self._others = min((self.where.workers or 1) - 1, len(self._open))
        if self._open and (self.where.dask or self._others):
            # a single process is in addition to this one
            executor = executor_of(self.where) if self.where.dask else Processes(self._others)
            self._background = Background(executor, front_of, partial(next_of, self._open))

    def free(self) -> int:
        """Processes in addition to this one that have no side search to work on."""
        busy = self._background is not None and not self._background.over
        return (self.where.workers or 1) - 1 - (self._others if busy else 0)

    def close(self) -> None:
        """End what still runs at once."""
        if self._background is not None:
            self._background.close()

    def collect(self) -> None:
        """Keep the fronts that have ended since; that of a lost process is computed again."""
        for task, front in self._background.taken() if self._background else ():
            if isinstance(front, Lost):
                self._open.append(task)
            else:
                self._keep(task.side, front)

    def finish(self) -> None:
        """Compute or wait for all fronts; an interrupt leaves out what has not been computed."""
        try:
            self._compute()
            if self._background is not None:
                self._background.wait()
                self.collect()
                self._compute()  # what was lost
        except KeyboardInterrupt:
            self.collect()

    def _compute(self) -> None:
        while self._open:
            try:
                side = self._open.pop().side
            except IndexError:  # begun elsewhere meanwhile
                return
            with recorded(self.checkpoint.section(side.key)):
                front = side.front(partial(self._report, side))
            self._keep(side, front)
            self.collect()

    def _report(self, side: SideSearch, state: Progress) -> None:
        """Pass the state of a side search on, under its own name."""
        self.collect()
        if self._progress is not None:
            step = f"{side.label}, {state.phase or f'generation {state.generation}'}"
            self._progress(replace(state, phase=step))

    def fronts(self) -> Fronts:
        """The front of each side search, None where it has not been computed."""
        return {side: self.checkpoint.tables.get(side.key) for side in self.searches}

    def _keep(self, side: SideSearch, front: pd.DataFrame | None) -> None:
        if front is None:  # it was interrupted
            raise KeyboardInterrupt
        if side.key not in self.checkpoint.tables:
            self.checkpoint.keep(side.key, front)
