"""Dask schedulers and workers of the tests' own, on the loopback."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

LOOPBACK = "127.0.0.1"


@contextmanager
def daemon(*words: object) -> Iterator[subprocess.Popen[str]]:
    """A Dask scheduler or worker of this test; its messages can be read."""
    process = subprocess.Popen(
        [sys.executable, "-m", "dask", *map(str, words)],
        stderr=subprocess.STDOUT, stdout=subprocess.PIPE, text=True,
        env=os.environ | {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "20"},
    )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        assert process.stdout is not None
        process.stdout.close()


@contextmanager
def scheduler() -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A scheduler on the loopback with its address."""
    bound = ("--host", LOOPBACK, "--port", 0, "--dashboard-address", f"{LOOPBACK}:0")
    with daemon("scheduler", *bound) as process:
        assert process.stdout is not None
        lines = (re.search(r"Scheduler at:\s+(tcp://127\.0\.0\.1:\d+)", x) for x in process.stdout)
        found = next(one for one in lines if one)
        threading.Thread(target=process.stdout.read, daemon=True).start()  # or its pipe is full
        yield process, found[1]


def worker(address: str) -> subprocess.Popen[bytes]:
    """A worker with one thread and no nanny that would start it anew."""
    bound = ("--host", LOOPBACK, "--dashboard-address", f"{LOOPBACK}:0")
    words = ("worker", address, *bound, "--nthreads", 1, "--no-nanny")
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *map(str, words)],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


@contextmanager
def cluster() -> Iterator[tuple[subprocess.Popen[str], str, list[subprocess.Popen[bytes]]]]:
    """A scheduler, its address, and two workers that have come; more may be added to the list."""
    with scheduler() as (process, address):
        workers = [worker(address) for _ in range(2)]
        try:
            wait_until(partial(both, address))
            yield process, address, workers
        finally:
            for one in workers:
                one.kill()
                one.wait()


def both(address: str) -> bool:
    """Whether both workers have come."""
    from distributed import Client

    with Client(address, timeout=10, set_as_default=False) as client:
        found: Any = client.scheduler_info()
        return len(found["workers"]) == 2


def wait_until(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    """Look again and again, and fail after so many seconds."""
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, "took too long"
        time.sleep(0.01)
