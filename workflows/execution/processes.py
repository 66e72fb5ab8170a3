"""Tasks in processes of this machine."""

from __future__ import annotations

import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, connection, get_context, parent_process
from multiprocessing.process import BaseProcess
from typing import Any

from ...interrupts import REQUESTS
from ...streams import warn_in_a_line
from .executor import ATTEMPTS, Executor, Lost, Result, TaskT
from .threads import VARIABLES

ORPHANED = 3
"""Exit status of a worker whose study was killed."""


class Processes(Executor):
    """`workers` pools of one process each: a killed one loses its own task only."""

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._lanes = [_Lane() for _ in range(workers)]
        self._closed = False

    def completed(
        self, function: Callable[[TaskT], Result], source: Callable[[], TaskT | None]
    ) -> Iterator[tuple[TaskT, Result | Lost]]:
        free, busy = list(self._lanes), dict[Future[Result], tuple[TaskT, _Lane, int]]()
        while True:
            while free and (task := source()) is not None:
                lane = free.pop()
                busy[lane.submit(function, task)] = task, lane, 1
            if not busy:
                return
            for future in wait(busy, return_when=FIRST_COMPLETED).done:
                task, lane, attempt = busy.pop(future)
                try:
                    result: Result | Lost = future.result()
                except (BrokenProcessPool, CancelledError):
                    if self._closed:  # from another thread
                        return
                    if attempt < ATTEMPTS:
                        busy[lane.submit(function, task)] = task, lane, attempt + 1
                        continue
                    result = Lost(f"its process was lost {attempt} times (killed, or out of memory)")
                free.append(lane)
                yield task, result

    def close(self) -> None:
        self._closed = True
        for lane in self._lanes:
            lane.close()


class _Lane:
    """A pool of one process, replaced when its process was lost."""

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None
        self._processes: set[BaseProcess] = set()

    def submit(self, function: Callable[[TaskT], Result], task: TaskT) -> Future[Result]:
        try:
            return self._started().submit(function, task)
        except BrokenProcessPool:  # lost between two tasks
            self.close()
            return self._started().submit(function, task)

    def _started(self) -> ProcessPoolExecutor:
        if self._pool is None:
            self._pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=_begin)
            existing = set(active_children())
            with _one_thread(), _uninterrupted():  # the process starts with its first task
                self._pool.submit(os.getpid)
            self._processes = set(active_children()) - existing
        return self._pool

    def close(self) -> None:
        for process in self._processes:
            process.kill()
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
        self._pool, self._processes = None, set()


@contextmanager
def _one_thread() -> Iterator[None]:
    """Processes that start in this context load their libraries with one thread."""
    before = {name: os.environ[name] for name in VARIABLES if name in os.environ}
    os.environ.update(dict.fromkeys(VARIABLES, "1"))
    try:
        yield
    finally:
        for name in set(VARIABLES) - set(before):
            del os.environ[name]
        os.environ.update(before)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Processes that start in this context leave interrupts to this one, from their first moment on."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, REQUESTS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin() -> None:
    """A worker leaves interrupts to its study, and ends with it, however that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, REQUESTS)
    warnings.showwarning = warn_in_a_line
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent,), daemon=True).start()


def _follow(parent: Any) -> None:
    connection.wait([parent.sentinel])
    os._exit(ORPHANED)
