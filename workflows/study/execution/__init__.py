"""Where tasks run: in this process, in processes of this machine, on a Dask scheduler."""

from __future__ import annotations

from .executor import Executor, Lost, Task
from .in_process import InProcess
from .processes import Processes
from .threads import pinned

__all__ = ["Executor", "InProcess", "Lost", "Processes", "Task", "pinned"]
