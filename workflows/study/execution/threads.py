"""One thread per worker: the libraries below numpy must not share the cores out again."""

from __future__ import annotations

from contextlib import AbstractContextManager, ExitStack

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables that those libraries read when they are loaded."""


def pinned() -> AbstractContextManager[object]:
    """A context in which numpy's libraries use one thread.

    The result of a sum may depend on the number of threads, so this holds in every process.
    """
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:  # then the environment variables alone hold
        return ExitStack()
    return threadpool_limits(limits=1)
