"""Progress on stderr: a bar on a terminal, sparse lines otherwise."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .algorithms.search import Progress
    from .workflows.blocks import BlockProgress
    from .workflows.gap.progress import GapProgress
    from .workflows.reproduce.plan import ClaimsProgress
    from .workflows.study.plan import StudyProgress

LINE_EVERY = 10.0
"""Seconds between two lines where stderr is not a terminal."""


def describe(progress: Progress) -> str:
    """Generation, evaluations, hypervolume and remaining time in one line."""
    step = f"generation {_of(progress.generation, progress.generations)}"
    evaluations = f"evaluations {_of(progress.evaluations, progress.evaluations_total)}"
    return f"{progress.phase or step}, {evaluations}, hypervolume {progress.hypervolume:.4f}{_remaining(progress)}"


def fraction(progress: Progress) -> float | None:
    """Fraction that is done, of the whole or of the budget; None where both are open."""
    if progress.share is not None:
        return progress.share
    pairs = ((progress.generation, progress.generations), (progress.evaluations, progress.evaluations_total))
    fractions = [done / total for done, total in pairs if total]
    if not fractions and progress.remaining is not None:
        fractions = [progress.seconds / max(progress.seconds + progress.remaining, 1e-9)]
    return min(1.0, max(fractions)) if fractions else None


def describe_study(progress: StudyProgress) -> str:
    """Runs done, running and failed, and the remaining time in one line."""
    text = f"runs {progress.done}/{progress.total} done, {progress.running} running, {progress.failed} failed"
    return text + _remaining(progress) + (f", {progress.note}" if progress.note else "")


def study_fraction(progress: StudyProgress) -> float | None:
    """Fraction of the runs that have ended."""
    return (progress.done + progress.failed) / progress.total if progress.total else None


def ended_share(progress: GapProgress | ClaimsProgress | BlockProgress) -> float | None:
    """Fraction of the parts that have ended; None where there are none."""
    return progress.done / progress.total if progress.total else None


def describe_gap(progress: GapProgress) -> str:
    """What is being done, replicates that have ended, and the remaining time in one line."""
    counted = f" {progress.done}/{progress.total}" if progress.total else ""
    return f"{progress.phase}{counted}{_remaining(progress)}"


def describe_claims(progress: ClaimsProgress) -> str:
    """Claims checked, the remaining time, and the claim that was checked last."""
    text = f"claims {progress.done}/{progress.total} checked, {progress.seconds:.0f} s"
    if progress.remaining is not None:
        text += f", some {progress.remaining:.0f} s left"
    elif progress.done < progress.total:
        text += ", all of them take some minutes"
    return f"{text}, {progress.note}" if progress.note else text


def describe_blocks(progress: BlockProgress) -> str:
    """Blocks that have ended, and the remaining time in one line."""
    return f"blocks {progress.done}/{progress.total}{_remaining(progress)}"


def _remaining(progress: Progress | StudyProgress | GapProgress | BlockProgress) -> str:
    return "" if progress.remaining is None else f", {progress.remaining:.0f} s left"


@dataclass(frozen=True)
class Display:
    """How the states of a command are shown: a line, the fraction that is done (None where it is
    not known), and a phase whose first state is always shown. A command of a single part shows
    nothing where it `counts_parts`: the part ends before a line would be read.
    """

    text: Callable[[Any], str]
    share: Callable[[Any], float | None] = ended_share
    phase: Callable[[Any], str] = lambda progress: ""
    counts_parts: bool = False


BLOCKS = Display(describe_blocks, counts_parts=True)
DISPLAYS: Mapping[str, Display] = {
    "run": Display(describe, fraction),
    "study": Display(describe_study, study_fraction),
    "gap": Display(describe_gap, phase=lambda progress: progress.phase),
    "reproduce": Display(describe_claims),
    "evaluate": BLOCKS,
    "simulate": BLOCKS,
}
"""By command."""


@contextmanager
def shown(command: str, quiet: bool) -> Iterator[Callable[[Any], None] | None]:
    """A function to call with every state of a command, None where nothing is to be shown."""
    display = DISPLAYS[command]
    if quiet:
        yield None
        return
    with _bar(display) if sys.stderr.isatty() else nullcontext(_lines(display)) as update:
        yield (lambda progress: update(progress) if progress.total > 1 else None) if display.counts_parts else update


def _of(done: int, total: int | None) -> str:
    return f"{done}" if total is None else f"{done}/{total}"


def _lines(display: Display) -> Callable[[Any], None]:
    """Prints the first report of each phase, and then one every `LINE_EVERY` seconds."""
    due, shown_last = 0.0, None

    def update(progress: Any) -> None:
        nonlocal due, shown_last
        phase = display.phase(progress)
        if time.monotonic() >= due or phase != shown_last:
            due, shown_last = time.monotonic() + LINE_EVERY, phase
            print(display.text(progress), file=sys.stderr, flush=True)

    return update


@contextmanager
def _bar(display: Display) -> Iterator[Callable[[Any], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as Bar

    columns = (BarColumn(), TextColumn("{task.description}"))
    bar = Bar(*columns, console=Console(stderr=True), transient=True)
    task = bar.add_task("starting", total=None)

    def update(progress: Any) -> None:
        bar.start()  # with the first report: earlier messages stand above the bar
        completed = display.share(progress)
        total = None if completed is None else 1.0
        bar.update(task, total=total, completed=completed, description=display.text(progress))

    try:
        yield update
    finally:
        bar.stop()
