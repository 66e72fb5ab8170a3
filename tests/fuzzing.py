"""How many damaged inputs are tried, for all tests that damage inputs at random.

500 in `make test`, 20,000 in `make test-long`; another number, or other ones, by the environment:
TOLEVO_EXAMPLES=3200 TOLEVO_EXAMPLES_SEED=7 python -m pytest -n 2 -k "broken or damaged or fuzz"
"""

from __future__ import annotations

import os
import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

EXAMPLES = int(os.environ.get("TOLEVO_EXAMPLES", "500"))
SEED = int(os.environ.get("TOLEVO_EXAMPLES_SEED", "1"))
HANG = 10
"""Seconds of computing after which a command hangs."""
MEMORY = 2**30
"""Bytes that no example may need."""


def share(percent: int, parts: int = 1) -> int:
    """How many of all examples are of one kind, in each of so many parts of it."""
    return max(1, EXAMPLES * percent // (100 * parts))


class Hang(BaseException):
    """Not caught by what catches exceptions."""


class TooLarge(AssertionError):
    """An example took more memory than any may."""


@contextmanager
def guarded() -> Iterator[None]:
    """Raise `Hang` after `HANG` seconds of computing, `TooLarge` where memory grew by over `MEMORY`.

    What the tests before have left in the process is no example's. What waits is ended by the time
    limit of a test.
    """

    def ring(number: int, frame: object) -> None:
        raise Hang

    peak, held = _peak(), _resident()
    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, HANG)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
    if _peak() > max(peak, held + MEMORY):
        raise TooLarge(f"{(_peak() - held) / MEMORY:.2f} GiB")


def _peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _resident() -> int:
    """Bytes of memory that this process holds now."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * resource.getpagesize()
