"""Progress on stderr: a bar on a terminal, sparse lines otherwise."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .algorithms.search import Progress

LINE_EVERY = 10.0
"""Seconds between two lines where stderr is not a terminal."""


def describe(progress: Progress) -> str:
    """Generation, evaluations, hypervolume and time left in one line."""
    step = f"generation {_of(progress.generation, progress.generations)}"
    parts = [
        progress.phase or step,
        f"evaluations {_of(progress.evaluations, progress.evaluations_total)}",
        f"hypervolume {progress.hypervolume:.4f}",
    ]
    if progress.remaining is not None:
        parts.append(f"{progress.remaining:.0f} s left")
    return ", ".join(parts)


def fraction(progress: Progress) -> float | None:
    """Share that is done, of the whole or of the budget; None where both are open."""
    if progress.share is not None:
        return progress.share
    pairs = (
        (progress.generation, progress.generations),
        (progress.evaluations, progress.evaluations_total),
    )
    shares = [done / total for done, total in pairs if total]
    if not shares and progress.remaining is not None:
        shares = [progress.seconds / max(progress.seconds + progress.remaining, 1e-9)]
    return min(1.0, max(shares)) if shares else None


@contextmanager
def shown(quiet: bool) -> Iterator[Callable[[Progress], None] | None]:
    """A function to call with every `Progress`, or None where nothing is to be shown."""
    if quiet:
        yield None
    elif sys.stderr.isatty():
        with _bar() as update:
            yield update
    else:
        yield _lines()


def _of(done: int, total: int | None) -> str:
    return f"{done}" if total is None else f"{done}/{total}"


def _lines() -> Callable[[Progress], None]:
    """Prints the first report, and then one every `LINE_EVERY` seconds."""
    due = 0.0

    def update(progress: Progress) -> None:
        nonlocal due
        if time.monotonic() >= due:
            due = time.monotonic() + LINE_EVERY
            print(describe(progress), file=sys.stderr, flush=True)

    return update


@contextmanager
def _bar() -> Iterator[Callable[[Progress], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as Bar

    columns = (BarColumn(), TextColumn("{task.description}"))
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=None)

        def update(progress: Progress) -> None:
            share = fraction(progress)
            total = None if share is None else 1.0
            bar.update(task, total=total, completed=share, description=describe(progress))

        yield update
