"""Tasks in this process, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from .executor import Executor, Lost, Result, TaskT


class InProcess(Executor):
    """Only this process; a task that ends it ends the study, which can be resumed."""

    workers = 1

    def completed(
        self, function: Callable[[TaskT], Result], source: Callable[[], TaskT | None]
    ) -> Iterator[tuple[TaskT, Result | Lost]]:
        while (task := source()) is not None:
            yield task, function(task)
