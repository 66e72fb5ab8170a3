"""Where tasks run: in this process, in processes of this machine, on a Dask scheduler."""

from __future__ import annotations

from ....errors import refuse
from .executor import Executor, Lost, Task
from .in_process import InProcess
from .processes import Processes
from .threads import pinned

__all__ = ["Executor", "InProcess", "Lost", "Processes", "Task", "executor_of", "pinned"]


def executor_of(workers: int, dask: str = "") -> Executor:
    """Where to run: on the Dask scheduler at an address, else in so many processes.

    Raises InputError where the extra for Dask is not installed, or nobody answers.
    """
    if not dask:
        return InProcess() if workers == 1 else Processes(workers)
    try:
        from .dask_cluster import DaskCluster
    except ImportError as error:
        text = f"needs Dask ({error}): pip install 'tolevo[study]'"
        raise refuse("--dask", text) from error
    return DaskCluster(dask)
