"""`tolevo study`: racing, the runs as tasks, their statistics, and its files."""

from __future__ import annotations

import hashlib
import json
import pickle
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import norm, rankdata

from ... import page_data
from ...directory import KINDS, Ownership, own_folder
from ...errors import RunError, StorageError
from ...execution import Executor, Lost
from ...files import csv_text, write_bytes, write_text, write_with
from ...page.drawing import as_png, as_svg
from ...page_data import as_json
from ...records import StudyResult, mechanism_lines, tables_of
from ...section import Array
from .page import figures, study_page
from .plan import (
    LARGER_IS_BETTER,
    Point,
    StudyData,
    StudyOutcome,
    StudyPlan,
    StudyProgress,
    StudySettings,
    Yardstick,
    needs_level,
    reference_box,
    unknown,
)
from .storage import CONFIGURATION, DAMAGE, DATABASE, Database, Unopened, check_resumable, open_study_store, reason
from .trial import Chunk, Curves, Job, RunRecord, Surveying, done, record_of_end, response_of

# Racing: settings that are behind beyond chance get no further seeds.
#
# After some seeds the settings still in the race are ranked within each seed (Friedman's ranks, which
# take any shape of the response, and common random numbers as they are). A setting leaves where its
# mean rank is behind that of the leader by more than z sqrt(k (k + 1) / (6 n)), k settings and n
# seeds: the standard deviation of the difference of two mean ranks where no setting differs, more
# than it is where the others differ as well. z is that of alpha / (k - 1), so that the best setting
# stays with a probability of 1 - alpha however many there are and look at it after look: look j has
# alpha / (j (j + 1)) of the whole alpha, whatever number of seeds is asked for (F-Race of Birattari
# et al. 2002, with a bound on the whole family in place of a test per look).


ALPHA = 0.05
"""Chance that the best setting of all leaves."""
FIRST = 5
"""Seeds before anything leaves."""
LEADERS = "leaders.csv"
"""Settings that are not behind beyond chance: as a table it is the design of a study on a finer
problem."""
STOPPED = "stopped"
"""Status of a run that is not made, as its setting is behind beyond chance."""


def looks(seeds: int) -> Iterator[int]:
    """Numbers of seeds after which settings are compared: 5, 7, 10, 14, 20, 28, ... below all."""
    at, step = float(FIRST), 2.0**0.5
    while round(at) < seeds:
        yield round(at)
        at *= step


def settings_behind_leader(costs: Array, look: int) -> NDArray[np.bool_]:
    """Which settings (k,) are behind the leader at a look (from 1); costs (k, seeds), less is
    better, infinite where a run failed or did not get there.
    """
    settings, seeds = costs.shape
    if settings < 2:
        return np.zeros(settings, dtype=bool)
    mean = rankdata(costs, axis=0).mean(axis=1)
    level = ALPHA / (look * (look + 1)) / (settings - 1)
    least = norm.isf(level) * np.sqrt(settings * (settings + 1) / (6.0 * seeds))
    return np.asarray(mean - mean.min() > least)


def trailing_settings(costs: Sequence[Array], racing: NDArray[np.bool_], look: int) -> NDArray[np.bool_]:
    """Settings (points,) of those still `racing` that are behind in every response.

    A setting that leads in one of them stays in all.
    """
    trailing = np.zeros(len(racing), dtype=bool)
    trailing[racing] = np.all(
        [settings_behind_leader(response_costs[racing], look) for response_costs in costs], axis=0
    )
    return trailing


def leaders(design: pd.DataFrame, costs: Sequence[Array]) -> pd.DataFrame:
    """The settings (rows of `design`) that are behind in none or not every response, by their ranks
    in the first; a run that was not made counts as the worst.
    """
    leading = ~trailing_settings(costs, np.ones(len(design), dtype=bool), 1)
    order = np.argsort(rankdata(costs[0], axis=0).mean(axis=1), kind="stable")
    return design.iloc[[row for row in order if leading[row]]].drop_duplicates()


# The statistics of a finished study, computed once.


STREAM = (0, 1)
"""Spawn key of the generator of the resampling."""
RECORD = "study.json"
FILES = (
    RECORD,
    LEADERS,
    *(declared.file for declared in tables_of(StudyResult).values()),
    "report.html",
    page_data.NAME,
)


def write_analysis(settings: StudySettings, data: StudyData, out: Path) -> tuple[str, ...]:
    """Write the statistics of the study to `out`, and return them in lines for the terminal.

    Where `out` already holds the statistics of the same runs, nothing is done again.
    """
    if (known := known_lines(settings, data, out)) is not None:
        return known
    digest = _digest(settings, data)
    from .analysis import analyse  # statsmodels takes seconds to import
    from .statistics import runs_of

    result = analyse(settings, data, np.random.default_rng(np.random.SeedSequence(settings.seed, spawn_key=STREAM)))
    write(result, out)
    costs = [runs_of(data.table, name, len(data.design)).costs() for name in settings.responses]
    write_text(out / LEADERS, csv_text(leaders(data.design[[factor.key for factor in settings.factors]], costs)))
    terminal_lines = lines(result)
    write_text(out / RECORD, study_record(result, {"digest": digest, "lines": list(terminal_lines)}))
    return terminal_lines


def _digest(settings: StudySettings, data: StudyData) -> str:
    """A hash of all that the statistics depend on."""
    parts = (data.table, data.design, data.exact)
    text = [settings.configuration, version("tolevo"), *(table.to_csv(index=False) for table in parts)]
    return hashlib.sha256("\n".join([*text, *data.notes]).encode()).hexdigest()


def known_lines(settings: StudySettings, data: StudyData, out: Path) -> tuple[str, ...] | None:
    """The lines of the statistics of the same runs that `out` holds already, else None."""
    if not all((out / name).is_file() for name in FILES):
        return None
    try:
        record = json.loads((out / RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(record, dict) or record.get("digest") != _digest(settings, data):
        return None
    return tuple(map(str, record.get("lines", ())))


# The runs of a study as tasks: handed out in chunks, recorded as they end.


CHUNK_S = 0.5
"""CPU time [s] of a chunk of short runs: handing one over costs some milliseconds."""
MAX_CHUNK_RUNS = 500
"""Runs of a chunk at most."""

Report = Callable[[StudyProgress], None]


class Work:
    """The remaining work of a study; `finish` does it."""

    def __init__(self, plan: StudyPlan, database: Database, executor: Executor, report: Report | None) -> None:
        self.plan = plan
        self.database = database
        self.executor = executor
        self._report = report
        self._problems = tuple(pickle.dumps(problem) for problem in plan.problems)
        self._identity = hashlib.sha256(plan.settings.configuration.encode()).hexdigest()[:16]
        self._version = version("tolevo")
        self._todo: deque[int] = deque()
        self._single: deque[Chunk] = deque()
        self._measures: dict[int, Yardstick] = {}
        self._boxes: dict[int, Yardstick] = {}
        self._surveys: deque[int] = deque()
        self._surveying = 0
        self._running = 0
        self._ended = 0
        self._cpu_s = 0.0
        self._start = time.monotonic()

    def finish(self) -> Mapping[int, Yardstick]:
        """Do every run that is missing.

        References that are not known yet are measured along with the first runs, but before them
        where a run must know its target, or where there is one process only: a study without a
        reference should end early. Returns all of them.
        """
        unknown = self._unmeasured()
        if unknown and needs_level(self._responses):
            self._until(0)
        elif unknown and self.executor.workers == 1:
            self._surveys = deque(unknown)
            self._work(self._survey)
        if self.plan.settings.hopeless:
            self._race()
        self._until(self.plan.total)
        self._report_progress()
        return self._measures

    def _unmeasured(self) -> list[int]:
        """Problems whose references are not measured yet."""
        self._measures = dict(self.database.yardsticks())
        return [n for n in range(len(self._problems)) if n not in self._measures]

    def _until(self, total: int) -> None:
        """Do the runs of the first `total` numbers, and compute the references that are missing."""
        self._todo, self._surveys = deque(self.database.missing(total)), deque(self._unmeasured())
        self._work(lambda: self._survey() or self._next())

    def _race(self) -> None:
        """Stop settings that are behind beyond chance.

        Each look is at the same runs wherever and however often interrupted they were made, so that
        the same settings are stopped each time.
        """
        points = len(self.plan.points)
        racing = np.ones(points, dtype=bool)
        for look, seeds in enumerate(looks(self.plan.settings.seeds), start=1):
            self._until(seeds * points)
            runs = list(self.database.runs(seeds * points))
            costs = [self._costs(name, runs, seeds) for name in self._responses]
            trailing = trailing_settings(costs, racing, look)
            racing &= ~trailing
            reason = f"behind beyond chance after {seeds} seeds"
            stopped = [
                record_of_end(self._job(replicate * points + int(point)), STOPPED, reason, self._responses)
                for point in np.flatnonzero(trailing)
                for replicate in range(seeds, self.plan.settings.seeds)
            ]
            self.database.record(stopped)

    def _costs(self, name: str, runs: Sequence[RunRecord], seeds: int) -> NDArray[np.float64]:
        """A response (points, seeds), less is better, infinite where there is none."""
        costs = np.full((len(self.plan.points), seeds), np.inf)
        sign = -1.0 if name in LARGER_IS_BETTER else 1.0
        for run in runs:
            measure = self._measures[self.plan.points[run.point].problem]
            value = sign * response_of(name, run, measure)
            costs[run.point, run.replicate] = np.inf if isnan(value) else value
        return costs

    @property
    def _responses(self) -> tuple[str, ...]:
        return self.plan.settings.responses

    def _work(self, source: Callable[[], Chunk | Surveying | None]) -> None:
        function: Callable[[Any], Any] = done  # a chunk of runs, or a reference
        tasks: Callable[[], Any] = source
        for task, result in self.executor.completed(function, tasks):
            if isinstance(task, Chunk):
                assert isinstance(result, Lost | tuple)
                self._record(task, result)
            else:
                assert not isinstance(result, tuple)
                self._measured(task, result)

    def _survey(self) -> Surveying | None:
        """The next reference that is to be measured."""
        if not self._surveys:
            return None
        number = self._surveys.popleft()
        self._surveying += 1
        self._report_progress()
        return Surveying(self._key("survey", str(number)), self._version, self._problems[number], number)

    def _measured(self, task: Surveying, reference: Yardstick | Lost) -> None:
        """Keep a reference. Raises RunError where a response cannot be computed without it."""
        if isinstance(reference, Lost):
            raise RunError(f"the reference of problem {task.number}: {reference.reason}")
        for name in self._responses:
            if text := unknown(name, reference):
                raise RunError(f"{name}: {text}")
        self.database.keep_yardstick(task.number, reference)
        self._measures[task.number] = reference
        self._surveying -= 1
        self._report_progress()

    def _measure(self, problem: int) -> Yardstick:
        """The reference of a problem or, as long as it is not known, the box alone."""
        if problem in self._measures:
            return self._measures[problem]
        if problem not in self._boxes:
            self._boxes[problem] = reference_box(self.plan.problems[problem])
        return self._boxes[problem]

    def _next(self) -> Chunk | None:
        """The next chunk of runs."""
        if self._single:
            chunk = self._single.popleft()
            self._running += len(chunk.jobs)
            return chunk
        if not self._todo:
            return None
        numbers = self._batch()
        self._running += len(numbers)
        self._report_progress()
        return self._chunk(numbers)

    def _batch(self) -> list[int]:
        """The next runs of one problem that take about `CHUNK_S` together."""
        size = 1
        if self._ended and self._cpu_s > 0.0:
            fair = len(self._todo) // (2 * max(1, self.executor.workers))
            size = min(int(CHUNK_S * self._ended / self._cpu_s), MAX_CHUNK_RUNS, fair)
        batch = [self._todo.popleft()]
        while self._todo and len(batch) < size:
            if self._point(self._todo[0]).problem != self._point(batch[0]).problem:
                break
            batch.append(self._todo.popleft())
        return batch

    def _chunk(self, numbers: list[int]) -> Chunk:
        problem = self._point(numbers[0]).problem
        return Chunk(
            self._key("runs", *map(str, numbers)),
            self._version,
            self._problems[problem],
            self._measure(problem),
            tuple(self._job(number) for number in numbers),
            self.plan.settings.responses,
            self.plan.time_limit_s,
        )

    def _job(self, number: int) -> Job:
        replicate, point = divmod(number, len(self.plan.points))
        at = self.plan.points[point]
        return Job(point, replicate, self.plan.seeds[replicate], at.algorithm, at.budget, at.engine)

    def _point(self, number: int) -> Point:
        return self.plan.points[number % len(self.plan.points)]

    def _record(self, chunk: Chunk, result: tuple[RunRecord, ...] | Lost) -> None:
        """Write what has ended. The runs of a chunk that was lost are tried one by one."""
        self._running -= len(chunk.jobs)
        if isinstance(result, Lost) and len(chunk.jobs) > 1:
            numbers = [job.replicate * len(self.plan.points) + job.point for job in chunk.jobs]
            self._single.extend(self._chunk([number]) for number in numbers)
            return
        if isinstance(result, Lost):
            result = tuple(record_of_end(job, "failed", result.reason, chunk.responses) for job in chunk.jobs)
        self.database.record(result)
        self._ended += len(result)
        self._cpu_s += sum(run.cpu_s for run in result if not isnan(run.cpu_s))
        self._report_progress()

    def _key(self, *parts: str) -> str:
        """The name of a task: the same for the same part of the same study."""
        return hashlib.sha256("/".join((self._identity, *parts)).encode()).hexdigest()[:32]

    def _report_progress(self) -> None:
        if self._report is None:
            return
        done, failed = self.database.count(self.plan.total)
        seconds = time.monotonic() - self._start
        remaining = seconds * (self.plan.total - done - failed) / self._ended if self._ended else None
        note = "measuring what the runs are compared with" if self._surveying else ""
        self._report(StudyProgress(done, self._running, failed, self.plan.total, seconds, remaining, note))


GO_ON = "run the same command with --resume"
TABLE = "study.csv"
STATE = KINDS["study"].state
"""The database, whose rows carry checksums of their own."""
KEPT_FILES = (CONFIGURATION, *STATE)
"""The files of the earlier command that a study needs to continue."""


def study(
    plan: StudyPlan,
    out: Path,
    executor: Executor,
    progress: Report | None = None,
    resume: bool = False,
    overwrite: bool = True,
) -> StudyOutcome:
    """Do every run of `plan` that the database in `out` does not have, then write the files.

    `study.csv` does not depend on the executor or on breaks. An interrupt leaves what has ended in
    the database. Raises InputError where `out` holds another study or has another owner, RunError
    where the study cannot go on.
    """
    with own_folder(out, "study", resume, overwrite, apart=STATE) as place:
        return _study(plan, place, executor, progress, resume)


def _study(
    plan: StudyPlan, place: Ownership, executor: Executor, progress: Report | None, resume: bool
) -> StudyOutcome:
    if not resume or place.blank:
        place.begin(keep=(CONFIGURATION,))  # so that nothing of an older study is opened
        write_text(place.folder / CONFIGURATION, plan.settings.configuration)
    else:
        check_resumable(place.folder)
    try:
        database, notes = open_study_store(plan, place.folder / DATABASE)
    except Unopened as error:
        raise place.unwritten(*error.args) from error
    with database:
        finished = place.standing.complete and not notes and not database.missing(plan.total)
        finished = finished and len(database.yardsticks()) == len(plan.problems)
        if not finished and not place.begun:
            _begin(plan, place)
        try:
            with executor:
                measures = Work(plan, database, executor, progress).finish()
            data = gather_tables(plan, database, measures, notes)
        except KeyboardInterrupt:
            return StudyOutcome("interrupted", place.folder, (f"interrupted: {_saved_message(database, plan)}",), None)
        except DAMAGE as error:
            raise RunError(f"{database.path}: {reason(error)}; {_saved_message(database, plan)}") from error
        except RunError as error:
            how = "" if isinstance(error, StorageError) else f"; {GO_ON}"
            raise RunError(f"{error}; {_count(database, plan)}{how}") from error
    return _write_study(plan, data, place, finished)


def _begin(plan: StudyPlan, place: Ownership) -> None:
    """Retire the files of an earlier end; the database stays."""
    place.begin(keep=KEPT_FILES)
    write_text(place.folder / CONFIGURATION, plan.settings.configuration)


def _saved_message(database: Database, plan: StudyPlan) -> str:
    return f"{_count(database, plan)}; {GO_ON} to continue"


def _count(database: Database, plan: StudyPlan) -> str:
    try:
        done, failed = database.count(plan.total)
    except DAMAGE:
        return f"what had ended is in {database.path}"
    return f"{done + failed} of {plan.total} runs have ended and are saved in {database.path.parent}"


def gather_tables(
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


def _write_study(plan: StudyPlan, data: StudyData, place: Ownership, finished: bool) -> StudyOutcome:
    """Write the files of a study whose runs have all ended; those of a finished one stay."""
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
    if finished:
        known = known_lines(plan.settings, data, out)
        if known is not None and (out / TABLE).read_bytes() == table.encode():
            return StudyOutcome("done", out, (*lines, *known), data)
        place.begin(keep=KEPT_FILES)
    write_text(out / CONFIGURATION, plan.settings.configuration)
    write_with(out / "curves.parquet", data.curves.copy_to)
    write_text(out / TABLE, table)
    if len(failed) == len(data.table):
        reason = failed["reason"].iloc[0]
        raise RunError(f"every run failed ({reason}): see study.csv; mend the cause, then start again with --overwrite")
    lines += write_analysis(plan.settings, data, out)
    place.complete()
    return StudyOutcome("done", out, tuple(lines), data)


# The files of the statistics of a study. Each appears whole or not at all.


def write(result: StudyResult, folder: Path) -> None:
    """Every table, every figure and the page."""
    page_data.write_tables(result, folder)
    for named in figures(result):
        write_bytes(folder / f"{named.name}.png", as_png(named.figure))
        write_bytes(folder / f"{named.name}.svg", as_svg(named.figure))
    write_text(folder / "report.html", study_page(result))
    write_text(folder / page_data.NAME, page_data.dump_result(result))


def study_record(result: StudyResult, more: Mapping[str, Any]) -> str:
    """`study.json`: recommendations, verdicts on readings, notes, and `more`."""
    record = {
        **({"mechanism": dict(result.mechanism)} if result.mechanism else {}),
        "recommendations": [asdict(recommendation) for recommendation in result.recommendations],
        "readings": [asdict(verdict) for verdict in result.verdicts],
        "notes": list(result.notes),
    }
    return as_json(record | dict(more))


def lines(result: StudyResult) -> tuple[str, ...]:
    """The lines of the result for the terminal."""
    sentences = mechanism_lines({"mechanism": result.mechanism})
    sentences += [f"recommended: {recommendation.sentence}" for recommendation in result.recommendations]
    sentences += [f"reading: {verdict.sentence}" for verdict in result.verdicts]
    return (*sentences, *(f"note: {note}" for note in result.notes))
