"""Where tasks run: in this process, in processes of this machine, on a Dask scheduler."""

from __future__ import annotations

from ...errors import Fault, InputError
from .background import Background, next_of
from .executor import Closing, Executor, Lost, Task
from .in_process import InProcess
from .processes import Processes
from .settings import Execution
from .shipped import built, check_version
from .threads import pinned

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
