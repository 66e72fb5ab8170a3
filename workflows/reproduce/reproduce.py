"""`tolevo reproduce`: every claim recomputed, its verdict, files."""

from __future__ import annotations

import hashlib
import time
from collections import deque
from collections.abc import Callable, Iterable
from importlib.metadata import version
from pathlib import Path

from ...directory import Ownership, owned
from ...errors import RunError, refuse
from ..execution import Executor, Lost
from .plan import ClaimsProgress, ReproduceOutcome, ReproducePlan
from .result import assembled, lines
from .storage import all_kept, files_of, holds_another, keep
from .task import Checked, ClaimTask, check
from .write import write

GO_ON = "run the same command with --resume to continue"
Report = Callable[[ClaimsProgress], None]


def reproduce(
    plan: ReproducePlan,
    out: Path,
    executor: Executor,
    progress: Report | None = None,
    resume: bool = False,
    overwrite: bool = True,
) -> ReproduceOutcome:
    """Check every claim of `plan` that `out` does not have, then write the files.

    The files do not depend on the executor or on breaks. Claims checked before an interrupt are
    kept. Raises RunError or ModelError where a claim cannot be computed, InputError where `out`
    holds something else that --resume cannot continue, or has another owner.
    """
    with owned(out, "reproduce", resume, overwrite) as place:
        return _reproduce(plan, place, executor, progress, resume)


def _reproduce(
    plan: ReproducePlan, place: Ownership, executor: Executor, progress: Report | None, resume: bool
) -> ReproduceOutcome:
    tasks, out = tuple(tasks_of(plan)), place.folder
    if resume and holds_another(place):
        raise refuse("--resume", f"{out} holds no claims: name the directory of a reproduction")
    known = all_kept(out, tasks) if resume else {}
    begin = len(known)
    place.begin(keep=files_of(out, (task for task in tasks if task.key in known)))
    try:
        _finish(tasks, known, out, executor, progress)
    except KeyboardInterrupt:
        saved = f"interrupted: {len(known)} of {len(tasks)} claims are checked and saved in {out}; {GO_ON}"
        return ReproduceOutcome("interrupted", out, (saved,))
    result = assembled(plan, [(task, known[task.key]) for task in tasks])
    write(result, out)
    place.complete()
    resumed_note = (f"{begin} claims had been checked before",) if begin else ()
    return ReproduceOutcome("done", out, (*lines(result), *resumed_note), result)


def tasks_of(plan: ReproducePlan) -> Iterable[ClaimTask]:
    """One task per claim, in the order of the files."""
    for document, source in enumerate(plan.sources):
        for number, claim in enumerate(source.file.claims):
            parts = (version("tolevo"), source.tables, str(source.file.seed), claim.id)
            key = hashlib.sha256("\n".join(parts).encode()).hexdigest()
            yield ClaimTask(key, document, number, claim, source.file.seed)


def _finish(
    tasks: tuple[ClaimTask, ...], known: dict[str, Checked], out: Path, executor: Executor, progress: Report | None
) -> None:
    """Check what is not known yet, and keep each claim as soon as it is checked."""
    remaining = deque(task for task in tasks if task.key not in known)
    start, before = time.monotonic(), len(known)

    def report(note: str = "") -> None:
        if progress is not None:
            seconds = time.monotonic() - start
            progress(ClaimsProgress(len(known), len(tasks), seconds, note, before))

    report()
    with executor:
        for task, outcome in executor.completed(check, lambda: remaining.popleft() if remaining else None):
            if isinstance(outcome, Lost):
                raise RunError(f"claim {task.claim.id}: {outcome.reason}; {GO_ON}")
            known[task.key] = outcome
            keep(out, task, outcome)
            report(task.claim.id)
