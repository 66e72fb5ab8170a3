"""The runs of a study as tasks: handed out in chunks, recorded as they end."""

from __future__ import annotations

import hashlib
import pickle
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from math import isnan
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...errors import RunError
from ..execution import Executor, Lost
from .plan import Point, StudyPlan, StudyProgress
from .racing import STOPPED, looks, trailing_settings
from .records import LARGER_IS_BETTER
from .responses import needs_level, unknown
from .trial import Chunk, Job, RunRecord, Surveying, done, ended, response_of
from .yardstick import Yardstick, box_alone

if TYPE_CHECKING:
    from .storage.database import Database

CHUNK_S = 0.5
"""CPU time [s] of a chunk of short runs: handing one over costs some milliseconds."""
MOST = 500
"""Runs of a chunk at most."""
POLL_S = 0.2
"""Seconds between two queries of what other processes have done."""

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
        """Do every run that is missing, and wait for those that other processes have begun.

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
        while True:
            missing, unknown = self.database.missing(total), self._unmeasured()
            if not missing and not unknown:
                return
            self._todo, self._surveys = deque(self.database.free(missing)), deque(unknown)
            before = self._ended, len(self._measures)
            self._work(lambda: self._survey() or self._next())
            if before == (self._ended, len(self._measures)):
                self._report_progress("another process has begun the remaining runs: waiting for it")
                time.sleep(POLL_S)

    def _race(self) -> None:
        """Stop settings that are behind beyond chance.

        Each look is at the same runs wherever and however often interrupted they were made, so that
        every process that shares the study stops the same settings.
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
                ended(self._job(replicate * points + int(point)), STOPPED, reason, self._responses)
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
        while self._surveys:
            number = self._surveys.popleft()
            if self.database.claim_yardstick(number):
                self._surveying += 1
                self._report_progress()
                key = self._key("survey", str(number))
                return Surveying(key, self._version, self._problems[number], number)
        return None

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
            self._boxes[problem] = box_alone(self.plan.problems[problem])
        return self._boxes[problem]

    def _next(self) -> Chunk | None:
        """The next chunk of runs that no other process does."""
        if self._single:
            chunk = self._single.popleft()
            self._running += len(chunk.jobs)
            return chunk
        while self._todo:
            taken = self.database.claim_runs(self._batch())
            if taken:
                self._running += len(taken)
                self._report_progress()
                return self._chunk(taken)
            self._todo = deque(self.database.free(list(self._todo)))  # others were quicker
        return None

    def _batch(self) -> list[int]:
        """The next runs of one problem that take about `CHUNK_S` together."""
        size = 1
        if self._ended and self._cpu_s > 0.0:
            fair = len(self._todo) // (2 * max(1, self.executor.workers))
            size = min(int(CHUNK_S * self._ended / self._cpu_s), MOST, fair)
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
            result = tuple(ended(job, "failed", result.reason, chunk.responses) for job in chunk.jobs)
        self.database.record(result)
        self._ended += len(result)
        self._cpu_s += sum(run.cpu_s for run in result if not isnan(run.cpu_s))
        self._report_progress()

    def _key(self, *parts: str) -> str:
        """The name of a task: the same for the same part of the same study."""
        return hashlib.sha256("/".join((self._identity, *parts)).encode()).hexdigest()[:32]

    def _report_progress(self, note: str = "") -> None:
        if self._report is None:
            return
        done, failed = self.database.count(self.plan.total)
        seconds = time.monotonic() - self._start
        remaining = seconds * (self.plan.total - done - failed) / self._ended if self._ended else None
        if self._surveying and not note:
            note = "measuring what the runs are compared with"
        self._report(StudyProgress(done, self._running, failed, self.plan.total, seconds, remaining, note))
