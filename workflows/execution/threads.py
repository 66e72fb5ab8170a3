"""One thread per worker: the libraries below numpy must not divide the cores a second time."""

from __future__ import annotations

from contextlib import AbstractContextManager, ExitStack
from functools import lru_cache
from typing import Any

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables that those libraries read when they are loaded."""


def pinned() -> AbstractContextManager[object]:
    """A context in which numpy's libraries use one thread.

    The result of a sum may depend on the number of threads, so this holds in every process.
    """
    controller = _controller()
    return ExitStack() if controller is None else controller.limit(limits=1)


@lru_cache(maxsize=1)
def _controller() -> Any:
    """What switches the libraries that are loaded; looking for them takes some milliseconds."""
    try:
        from threadpoolctl import ThreadpoolController
    except ImportError:  # then the environment variables alone hold
        return None
    return ThreadpoolController()
