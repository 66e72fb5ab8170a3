"""Where tasks run: in this process, in processes of this machine, on a Dask scheduler."""

from __future__ import annotations

import os
import pickle
import signal
import threading
import warnings
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import version
from multiprocessing import active_children, connection, get_context, parent_process
from multiprocessing.process import BaseProcess
from typing import Any, Generic, Protocol, Self, TypeVar

from .errors import Fault, InputError, RunError
from .interrupts import REQUESTS, warn_in_a_line

__all__ = [
    "Background",
    "Closing",
    "Execution",
    "Executor",
    "InProcess",
    "Lost",
    "Processes",
    "Task",
    "built",
    "check_version",
    "executor_of",
    "next_of",
    "pinned",
    "unreachable",
]

# What runs tasks: the interface, this process itself, and a thread beside it.
#
# One thread per worker: the libraries below numpy must not divide the cores a second time. Objects
# that are sent to workers are pickled once, built once, and of the same version.


ATTEMPTS = 3
"""Workers that may be lost in a task before it is given up."""
MAX_CACHED_OBJECTS = 4
"""Objects that a worker keeps built."""
VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables that those libraries read when they are loaded."""


@dataclass(frozen=True, slots=True)
class Execution:
    """`[execution]` of a configuration, or the options of a command: no result depends on it.

    `workers` are processes of this machine, `dask` the address of a scheduler instead of them,
    `block_rows` the rows of a block of a table; None where nothing is stated.
    """

    workers: int | None = None
    dask: str = ""
    block_rows: int | None = None
    dask_place: str = "--dask"
    """Where the address stands, as faults name it."""


class Task(Protocol):
    """A task: a picklable value with a name. Equal keys are equal tasks."""

    @property
    def key(self) -> str:
        """The name."""
        ...


@dataclass(frozen=True, slots=True)
class Lost:
    """In place of a result: `ATTEMPTS` workers were lost in the task."""

    reason: str


TaskT = TypeVar("TaskT", bound=Task)
Result = TypeVar("Result")


class Closing:
    """A context that is closed at its end."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End what still runs."""


class Executor(Closing, ABC):
    """Runs pure functions of tasks. A context: leaving it ends what still runs."""

    workers: int
    """Tasks that run at once, as far as is known."""

    @abstractmethod
    def completed(
        self, function: Callable[[TaskT], Result], source: Callable[[], TaskT | None]
    ) -> Iterator[tuple[TaskT, Result | Lost]]:
        """Tasks with their results, as they end.

        `source` hands out the next task, None where there is none at the moment; it is asked again
        after each result. It ends when nothing runs and there is no task. A lost worker's task is
        run again; what `function` raises is raised here.
        """


class InProcess(Executor):
    """Only this process; a task that ends it ends the study, which can be resumed."""

    workers = 1

    def completed(
        self, function: Callable[[TaskT], Result], source: Callable[[], TaskT | None]
    ) -> Iterator[tuple[TaskT, Result | Lost]]:
        while (task := source()) is not None:
            yield task, function(task)


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


@lru_cache(maxsize=MAX_CACHED_OBJECTS)
def built(content: bytes) -> Any:
    """The pickled object; the next task with the same one finds it built."""
    return pickle.loads(content)


def check_version(sent: str) -> None:
    """Raises RunError where a worker has another version of the package than the sender."""
    installed = version("tolevo")
    if sent != installed:
        raise RunError(f"a worker has tolevo {installed}, this is {sent}: install the same everywhere")


@contextmanager
def pinned() -> Iterator[None]:
    """A context, or `@pinned()` above a function, in which numpy's libraries use one thread.

    The result of a sum may depend on the number of threads, so this holds in every process.
    """
    controller = _controller()
    with ExitStack() if controller is None else controller.limit(limits=1):
        yield


@lru_cache(maxsize=1)
def _controller() -> Any:
    """What switches the libraries that are loaded, scipy's own among them; to look for them takes some milliseconds."""
    try:
        import scipy.linalg  # noqa: F401 - a library that is loaded later would keep its threads
        from threadpoolctl import ThreadpoolController
    except ImportError:  # then the environment variables alone hold
        return None
    return ThreadpoolController()


# Tasks in processes of this machine.


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


_STARTING = threading.Lock()
"""Held while a process starts: of its variables of the environment, and of the children that are there, one
thread alone must know.
"""


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
        with _STARTING:
            if self._pool is None:
                self._pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=_begin)
                existing = set(active_children())
                with _one_thread(), _ignore_interrupts():  # the process starts with its first task
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
def _ignore_interrupts() -> Iterator[None]:
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
        threading.Thread(target=_exit_with_parent, args=(parent,), daemon=True).start()


def _exit_with_parent(parent: Any) -> None:
    connection.wait([parent.sentinel])
    os._exit(ORPHANED)


def executor_of(execution: Execution | int, dask: str = "") -> Executor:
    """Where to run: on the Dask scheduler at an address, else in so many processes.

    Raises InputError where the extra for Dask is not installed, no scheduler answers, or workers
    have another version.
    """
    if isinstance(execution, int):
        execution = Execution(execution, dask)
    workers, dask, place = execution.workers or 1, execution.dask, execution.dask_place
    if not dask:
        return InProcess() if workers == 1 else Processes(workers)
    try:
        from .dask_cluster import DaskCluster
    except ImportError as error:
        text = f"needs Dask ({error}): pip install 'tolevo[study]'"
        raise InputError([Fault(place, text)]) from error
    return DaskCluster(dask, place)


def unreachable(execution: Execution) -> list[Fault]:
    """What is wrong with the Dask scheduler that is asked for; empty where none is asked for."""
    if not execution.dask:
        return []
    try:
        executor_of(execution).close()
    except InputError as error:
        return list(error.faults)
    return []
