"""`tolevo study`: many runs, their table, and its statistics."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ...csv_text import csv_text
from ...directory import KINDS, Ownership, owned
from ...errors import Fault, RunError, StorageError
from ...files import write_text, write_with
from ..execution import Executor
from .analysed import analysed, known_lines
from .curves import Curves
from .plan import StudyOutcome, StudyPlan
from .racing import STOPPED
from .records import StudyData
from .storage.names import CONFIGURATION
from .storage.site import Site
from .trial import response_of
from .work import Report, Work
from .yardstick import Yardstick

if TYPE_CHECKING:
    from .storage.database import Database

GO_ON = "run the same command with --resume"
TABLE = "study.csv"
STATE = KINDS["study"].state
"""The database, whose rows carry checksums of their own."""
KEPT = (CONFIGURATION, *STATE)
"""The files of the earlier command that a study needs to continue."""


def study(
    plan: StudyPlan,
    out: Path,
    executor: Executor,
    progress: Report | None = None,
    resume: bool = False,
    overwrite: bool = True,
    store: str = "",
) -> StudyOutcome:
    """Do every run of `plan` that the database in `out` does not have, then write the files.

    With an address of a `store` that is shared, the runs are there, and other machines may be at
    work on them, each with its own directory.

    `study.csv` does not depend on the executor, on breaks, or on how many processes share the
    study: with `resume` others may be at work on it, and the last one through writes the files. An
    interrupt leaves what has ended in the database. Raises InputError where `out` holds another
    study or has another owner, RunError where the study cannot go on.
    """
    with owned(out, "study", resume, overwrite, shared=True, apart=STATE) as place:
        return _study(plan, place, Site(out, store), executor, progress, resume)


def _study(
    plan: StudyPlan, place: Ownership, site: Site, executor: Executor, progress: Report | None, resume: bool
) -> StudyOutcome:
    from ..store.backend import DAMAGE, reason  # with it comes SQLAlchemy, slow to load
    from .storage.opening import Unopened, opened

    if not resume or place.blank:
        place.begin(keep=(CONFIGURATION,))  # so that nothing of an older study is opened
        write_text(place.folder / CONFIGURATION, plan.settings.configuration)
        site.begin()
    else:
        site.check()
    try:
        database, notes = opened(plan, site.backend(), not place.joined, site.prefix)
    except Unopened as error:
        raise place.unwritten(*error.args) from error
    with database:
        finished = place.standing.complete and not notes and not database.missing(plan.total)
        finished = finished and len(database.yardsticks()) == len(plan.problems)
        if not finished:
            if not place.begun:
                _begin(plan, place)
            place.share()
        try:
            with executor:
                measures = Work(plan, database, executor, progress).finish()
            data = gathered(plan, database, measures, notes)
        except KeyboardInterrupt:
            return StudyOutcome("interrupted", place.folder, (f"interrupted: {_saved(database, plan, site)}",))
        except DAMAGE as error:
            where, saved = database.backend.display_name, _saved(database, plan, site)
            raise RunError(f"{where}: {reason(error)}; {saved}") from error
        except RunError as error:
            how = "" if isinstance(error, StorageError) else f"; {GO_ON}"
            raise RunError(f"{error}; {_count(database, plan, site)}{how}") from error
    return _written(plan, data, place, finished)


def _begin(plan: StudyPlan, place: Ownership) -> None:
    """Retire the files of an earlier end; the database stays."""
    place.begin(keep=KEPT)
    write_text(place.folder / CONFIGURATION, plan.settings.configuration)


def _saved(database: Database, plan: StudyPlan, site: Site) -> str:
    return f"{_count(database, plan, site)}; {GO_ON} to continue"


def _count(database: Database, plan: StudyPlan, site: Site) -> str:
    from ..store.backend import DAMAGE

    try:
        done, failed = database.count(plan.total)
    except DAMAGE:
        return f"what had ended is in {database.backend.display_name}"
    return f"{done + failed} of {plan.total} runs have ended and are saved in {site.location}"


def gathered(
    plan: StudyPlan, database: Database, measures: Mapping[int, Yardstick], notes: tuple[str, ...]
) -> StudyData:
    """The tables of a study from its database."""
    rows: list[tuple[Any, ...]] = []
    responses: list[list[float]] = []
    with Curves() as curves:
        for point, setting in enumerate(plan.points):
            runs, measure = database.of_point(point, plan.total), measures[setting.problem]
            curves.add(point, runs)
            rows += [(point, run.replicate, run.seed, run.status, run.reason) for run in runs]
            responses += [[response_of(name, run, measure) for name in plan.settings.responses] for run in runs]
    table = pd.DataFrame(rows, columns=["point", "replicate", "seed", "status", "reason"])
    columns = {"point": table["point"].to_numpy()}
    columns |= {factor.key: plan.design[factor.key].to_numpy()[table["point"]] for factor in plan.settings.factors}
    columns |= {name: table[name].to_numpy() for name in ("replicate", "seed", "status", "reason")}
    values = np.array(responses, dtype=float).reshape(len(table), -1)
    columns |= dict(zip(plan.settings.responses, values.T, strict=True))
    exact = [measures[point.problem].value for point in plan.points]
    frame = pd.DataFrame({"point": np.arange(len(exact)), "value": exact})
    return StudyData(pd.DataFrame(columns), plan.design, curves, frame, notes)


def _written(plan: StudyPlan, data: StudyData, place: Ownership, finished: bool) -> StudyOutcome:
    """Write the files of a study whose runs have all ended, where no other process has done so."""
    out, table = place.folder, csv_text(data.table)
    failed = data.table[data.table["status"] == "failed"]
    lines = [f"done: {len(data.table)} runs of {len(plan.points)} settings, {len(failed)} failed"]
    if len(failed):
        reason, times = next(iter(failed["reason"].value_counts().items()))
        lines.append(f"note: {times} runs failed with: {reason}")
    stopped = data.table.loc[data.table["status"] == STOPPED, "point"]
    if len(stopped):
        lines.append(
            f"note: {stopped.nunique()} settings were stopped as they are behind beyond "
            f"chance, which saved {len(stopped)} of {len(data.table)} runs"
        )
    if not finished and not place.exclude():
        _check_same(plan, out)
        finished = True
    if finished:
        known = known_lines(plan.settings, data, out)
        if known is not None and (out / TABLE).read_bytes() == table.encode():
            return StudyOutcome("done", out, (*lines, *known), data)
        place.begin(keep=KEPT)
    write_text(out / CONFIGURATION, plan.settings.configuration)
    write_with(out / "curves.parquet", data.curves.copy_to)
    write_text(out / TABLE, table)
    if len(failed) == len(data.table):
        reason = failed["reason"].iloc[0]
        raise RunError(f"every run failed ({reason}): see study.csv; mend the cause, then start again with --overwrite")
    lines += analysed(plan.settings, data, out)
    place.complete()
    return StudyOutcome("done", out, tuple(lines), data)


def _check_same(plan: StudyPlan, out: Path) -> None:
    """Raises RunError where the finished study in `out` is another one."""
    from .storage.opening import differences

    try:
        faults = differences((out / CONFIGURATION).read_text(encoding="utf-8"), plan.settings.configuration)
    except (OSError, ValueError):
        faults = [Fault("", "")]
    if faults:
        raise RunError(
            f"{out} was taken by another study meanwhile; name another directory, or start again with --overwrite"
        )
