"""`tolevo study`: many runs, their table, and what it says."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from ...algorithms.course import CURVE
from ...errors import RunError, refuse
from ...files import write_text, write_with
from .analysed import FILES as SAID
from .analysed import analysed
from .execution import Executor
from .plan import StudyOutcome, StudyPlan
from .records import StudyData
from .responses import unknown
from .storage import DATABASE, Database, opened
from .storage.opening import CONFIGURATION
from .storage.owners import at_work
from .work import Report, Work
from .yardstick import Yardstick

GO_ON = "run the same command with --resume to go on"
FILES = ("study.csv", "curves.parquet", *SAID)
"""Files of a finished study, removed while it is not finished."""


def study(
    plan: StudyPlan,
    out: Path,
    executor: Executor,
    progress: Report | None = None,
    resume: bool = False,
) -> StudyOutcome:
    """Do every run of `plan` that the database in `out` does not have, then write the files.

    `study.csv` does not depend on the executor, on breaks, or on how many processes share the
    study. An interrupt leaves what has ended in the database. Raises InputError where `out` holds
    another study, RunError where the study cannot go on.
    """
    _begin(out, resume)
    database, notes = opened(plan, out)
    with database:
        write_text(out / CONFIGURATION, plan.settings.configuration)
        try:
            measures = _done(Work(plan, database, executor, progress), plan)
        except KeyboardInterrupt:
            return StudyOutcome("interrupted", out, (_saved(database, plan, out),))
        except sqlite3.Error as error:
            raise RunError(f"{out / DATABASE}: {error}; {_saved(database, plan, out)}") from error
        except RunError as error:
            raise RunError(f"{error}; {_saved(database, plan, out)}") from error
        data = gathered(plan, database, measures, notes)
    return _written(plan, data, out)


def _begin(out: Path, resume: bool) -> None:
    """Clear the directory for a new study."""
    if not out.is_dir():
        return
    busy = at_work(out)
    if busy and not resume:
        pids = ", ".join(name.split("-")[0] for name in busy)
        raise refuse("--overwrite", f"another process works on the study in {out} (pid {pids}): "
                     "wait for it or end it; with --resume this one would help it")  # fmt: skip
    if not resume:
        for name in (*FILES, DATABASE, f"{DATABASE}-wal", f"{DATABASE}-shm"):
            (out / name).unlink(missing_ok=True)


def _done(work: Work, plan: StudyPlan) -> Mapping[int, Yardstick]:
    with work.executor:
        measures = work.survey()
        for name in plan.settings.responses:
            for measure in measures.values():
                if text := unknown(name, measure):
                    raise RunError(f"{name}: {text}")
        work.finish()
    return measures


def _saved(database: Database, plan: StudyPlan, out: Path) -> str:
    try:
        done, failed = database.count(plan.total)
    except sqlite3.Error:
        return f"what had ended is in {out / DATABASE}; {GO_ON}"
    return f"{done + failed} of {plan.total} runs have ended and are saved in {out}; {GO_ON}"


def gathered(
    plan: StudyPlan, database: Database, measures: Mapping[int, Yardstick], notes: tuple[str, ...]
) -> StudyData:
    """The tables of a study from its database."""
    runs = list(database.runs(plan.total))
    at = [run.point for run in runs]
    keys = [factor.key for factor in plan.settings.factors]
    columns = {"point": at} | {key: plan.design[key].to_numpy()[at] for key in keys}
    columns |= {
        name: [getattr(run, name) for run in runs]
        for name in ("replicate", "seed", "status", "reason")
    }
    for name in plan.settings.responses:
        columns[name] = np.array([run.responses[name] for run in runs], dtype=float)
    lengths = [len(run.curve) for run in runs]
    curves = pd.DataFrame({
        "point": np.repeat(at, lengths),
        "replicate": np.repeat([run.replicate for run in runs], lengths),
    })  # fmt: skip
    values = np.concatenate([np.empty((0, len(CURVE))), *(run.curve for run in runs)])
    for place, name in enumerate(CURVE):
        whole = name in ("generation", "evaluations")
        curves[name] = values[:, place].astype(np.int64) if whole else values[:, place]
    exact = [measures[point.problem].value for point in plan.points]
    frame = pd.DataFrame({"point": np.arange(len(exact)), "value": exact})
    return StudyData(pd.DataFrame(columns), plan.design, curves, frame, notes)


def _written(plan: StudyPlan, data: StudyData, out: Path) -> StudyOutcome:
    """Write the files of a study all of whose runs have ended."""
    write_with(out / "curves.parquet", lambda path: data.curves.to_parquet(path, index=False))
    write_text(out / "study.csv", data.table.to_csv(index=False))
    failed = data.table[data.table["status"] == "failed"]
    if len(failed) == len(data.table):
        reason = failed["reason"].iloc[0]
        raise RunError(f"every run failed ({reason}): see study.csv; mend the cause, then "
                       "start again with --overwrite")  # fmt: skip
    lines = [f"done: {len(data.table)} runs of {len(plan.points)} settings, {len(failed)} failed"]
    if len(failed):
        reason, times = next(iter(failed["reason"].value_counts().items()))
        lines.append(f"note: {times} runs failed with: {reason}")
    lines += analysed(plan.settings, data, out)
    return StudyOutcome("done", out, tuple(lines), data)
