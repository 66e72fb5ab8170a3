"""How large a count may be: what it would take is estimated before anything is computed.

A count declares its `Need` where its range is declared: `Parameter(need=...)` of a model, problem
or calculation, `field(metadata={"need": ...})` of an algorithm or a design, `Section.integer`.
A count without a `Need` is taken for numbers that are stored (`PLAIN`). The budgets do not depend
on the machine, so that a configuration is accepted everywhere or nowhere; `--force` lifts them.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

MEMORY = 8.0 * 2**30
"""Bytes that one count may take."""
TIME = 30.0 * 86_400.0
"""Seconds that one count may take on one core."""
_HUGE = 10**100
"""Larger counts are replaced by this number: it exceeds every budget, and is still a float."""
_TIMES = (("years", 365.25 * 86_400.0), ("days", 86_400.0), ("hours", 3600.0), ("s", 1.0))
_SIZES = (("TiB", 2.0**40), ("GiB", 2.0**30), ("MiB", 2.0**20), ("KiB", 2.0**10))
_FORCED: ContextVar[bool] = ContextVar("forced", default=False)


@dataclass(frozen=True, slots=True)
class Need:
    """What a count takes: bytes and seconds per item, and bytes per pair where all items are
    compared with all others.

    `of` is what is counted ("individual"). The numbers are measured, and rather too low: a count
    that is refused is really too large.
    """

    of: str
    bytes: float = 0.0
    seconds: float = 0.0
    bytes_per_pair: float = 0.0

    def memory(self, count: int) -> float:
        """Bytes that the count takes."""
        number = float(min(count, _HUGE))
        return number * self.bytes + number * number * self.bytes_per_pair

    def time(self, count: int) -> float:
        """Seconds that the count takes."""
        return float(min(count, _HUGE)) * self.seconds

    @property
    def most(self) -> int:
        """The largest count within both budgets, rounded down to two digits."""
        ends = [MEMORY / self.bytes] if self.bytes else []
        if self.bytes_per_pair:
            half = 0.5 * self.bytes / self.bytes_per_pair
            ends.append(math.sqrt(half * half + MEMORY / self.bytes_per_pair) - half)
        ends += [TIME / self.seconds] if self.seconds else []
        least = int(min(ends, default=_HUGE))
        step: int = 10 ** max(len(str(least)) - 2, 0)
        return least // step * step


PLAIN = Need("number", bytes=8.0)
"""For a count that declares nothing: a number is stored per item."""
INDIVIDUALS = Need("individual", bytes=2.5e3, seconds=2e-5)
"""For a population: pymoo stores an object per individual."""
PAIRED = Need("individual", bytes=2.5e3, seconds=2e-5, bytes_per_pair=15.0)
"""For a population whose members are compared pairwise, as reference directions are."""
GENERATIONS = Need("generation", bytes=400.0, seconds=1e-3)
EVALUATIONS = Need("evaluation", seconds=2e-5)
POINTS = Need("point", bytes=1.5e3, seconds=1e-3)
"""For a front: a row of every variable and output."""
SAMPLES = Need("sample", bytes=120.0, seconds=1e-6)
"""Units that are drawn, with a dozen inputs per unit."""
SETTINGS = Need("setting", bytes=2e4, seconds=0.05)
"""For a study: a setting is read as a run configuration, and runs once at least."""
RUNS = Need("run", bytes=1e4, seconds=0.05)
"""For a study: the course of every run is stored."""
BLOCK_ROWS = Need("row", bytes=1e3, seconds=1e-6)
"""For a block of a table: a worker holds all of them, with every column."""
PER_CORE = 16
"""Processes that may be asked for per core of the machine."""
PROCESS = 2.0e8
"""Bytes of a process with the package loaded."""


@contextmanager
def forced(force: bool = True) -> Iterator[None]:
    """Within it no count is refused for its size, if `force` is true."""
    token = _FORCED.set(force or _FORCED.get())
    try:
        yield
    finally:
        _FORCED.reset(token)


def is_forced() -> bool:
    """Whether counts are accepted whatever their size."""
    return _FORCED.get()


def too_many(count: int, need: Need, per: int = 1, product: str = "") -> str:
    """What is wrong with a count; empty where it is within the budgets, or asked for.

    Each of them may be `per` of what `need` says, which `product` then names ("seeds x settings").
    """
    total, most = count * per, need.most // max(per, 1)
    if total <= need.most or is_forced():
        return ""
    taken = []
    if need.memory(total) > MEMORY:
        taken.append(f"{size(need.memory(total))} of memory ({size(MEMORY)} at most)")
    if need.time(total) > TIME:
        taken.append(f"{duration(need.time(total))} of computing ({duration(TIME)} at most)")
    number = shown(count)
    if product:
        number += f" would be {shown(total)} {need.of}s ({product}), which"
    cost = " and ".join(taken) or size(need.memory(total))
    remedy = f"give at most {most}" if most else "give fewer of both"
    return f"{number} would need about {cost}: {remedy}, or add --force"


def too_many_workers(count: int) -> str:
    """What is wrong with a number of processes; empty where nothing is, or if it is asked for."""
    cores = os.cpu_count() or 1
    if count <= PER_CORE * cores or is_forced():
        return ""
    text = f"{count} processes would need about {size(count * PROCESS)} of memory, and the cores are"
    return f"{text} {cores}: give at most {PER_CORE * cores}, or add --force"


def shown(count: int) -> str:
    """A count as text; one of many digits by its power of ten."""
    return str(count) if count < 10**18 else f"about 1e{int(math.log10(count))}"


def size(number: float) -> str:
    """Bytes in a unit that fits."""
    return _scaled(number, _SIZES)


def duration(seconds: float) -> str:
    """A time in a unit that fits."""
    return _scaled(seconds, _TIMES)


def _scaled(number: float, units: tuple[tuple[str, float], ...]) -> str:
    """A number in the largest unit that it reaches, or the smallest one."""
    name, unit = next((entry for entry in units if number >= entry[1]), units[-1])
    return f"{number / unit:.3g} {name}"
