"""Tasks during the work of this process: an executor in a separate thread."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic

from .executor import Executor, Lost, Result, TaskT


def next_of(tasks: deque[TaskT]) -> TaskT | None:
    """The first task taken out, None where none remains: another thread may take the last."""
    try:
        return tasks.popleft()
    except IndexError:
        return None


class Background(Generic[TaskT, Result]):
    """`function` of the tasks that `source` hands out, while this process does something else.

    `source` is called in the other thread, and whenever a worker is free: the tasks that remain in
    it may be done here as well.
    """

    def __init__(
        self, executor: Executor, function: Callable[[TaskT], Result], source: Callable[[], TaskT | None]
    ) -> None:
        self._executor = executor
        self._ended: list[tuple[TaskT, Result | Lost]] = []
        self._error: BaseException | None = None
        self._closed = False
        self._thread = threading.Thread(target=self._work, args=(function, source), daemon=True)
        self._thread.start()

    def _work(self, function: Callable[[TaskT], Result], source: Callable[[], TaskT | None]) -> None:
        try:
            for pair in self._executor.completed(function, source):
                self._ended.append(pair)
        except BaseException as error:
            self._error = error

    @property
    def over(self) -> bool:
        """Whether nothing runs any more."""
        return not self._thread.is_alive()

    def taken(self) -> list[tuple[TaskT, Result | Lost]]:
        """Tasks ended since, with results. Raises what was raised in a task or by the executor."""
        ended, self._ended = self._ended, []
        if self._error is not None and not self._closed and not ended:
            error, self._error = self._error, None
            raise error
        return ended

    def wait(self) -> None:
        """Wait until nothing runs."""
        self._thread.join()

    def close(self) -> None:
        """End what still runs."""
        self._closed = True
        self._executor.close()
        self._thread.join()
