"""The runs of a study as tasks: handed out in chunks, taken in as they end."""

from __future__ import annotations

import hashlib
import pickle
import time
from collections import deque
from collections.abc import Callable, Mapping
from importlib.metadata import version
from math import isnan

from ..execution import Executor, Lost
from .plan import Point, StudyPlan, StudyProgress
from .storage import Database
from .trial import Chunk, Job, RunRecord, Surveying, lost, perform, survey
from .yardstick import Yardstick

CHUNK_S = 0.5
"""CPU time [s] of a chunk of short runs: handing one over costs some milliseconds."""
MOST = 500
"""Runs of a chunk at most."""
POLL_S = 0.2
"""Seconds between two looks at what other processes have done."""

Report = Callable[[StudyProgress], None]


class Work:
    """Everything that is left to be done of a study; `finish` does it."""

    def __init__(
        self, plan: StudyPlan, database: Database, executor: Executor, report: Report | None
    ) -> None:
        self.plan = plan
        self.database = database
        self.executor = executor
        self._report = report
        self._problems = tuple(pickle.dumps(problem) for problem in plan.problems)
        self._identity = hashlib.sha256(plan.settings.configuration.encode()).hexdigest()[:16]
        self._version = version("tolevo")
        self._todo: deque[int] = deque()
        self._alone: deque[Chunk] = deque()
        self._measures: Mapping[int, Yardstick] = {}
        self._running = 0
        self._own = 0
        self._cpu_s = 0.0
        self._start = time.monotonic()

    def survey(self) -> Mapping[int, Yardstick]:
        """Find the yardsticks that are not known yet; returns all of them."""
        known = self.database.yardsticks()
        open_ = deque(n for n in range(len(self._problems)) if n not in known)
        self._tell("measuring what the runs are compared with" if open_ else "")

        def source() -> Surveying | None:
            if not open_:
                return None
            number = open_.popleft()
            key = self._key("survey", str(number))
            return Surveying(key, self._version, self._problems[number], number)

        for task, found in self.executor.completed(survey, source):
            if isinstance(found, Lost):
                raise RuntimeError(found.reason)
            self.database.keep_yardstick(task.number, found)
        self._measures = self.database.yardsticks()
        return self._measures

    def finish(self) -> None:
        """Do every run that is missing, and wait for those that other processes have begun."""
        while missing := self.database.missing(self.plan.total):
            self._todo.extend(missing)
            before = self._own
            for chunk, result in self.executor.completed(perform, self._next):
                self._take(chunk, result)
            if self._own == before:
                self._tell("another process has begun what is left: waiting for it")
                time.sleep(POLL_S)
        self._tell()

    def _next(self) -> Chunk | None:
        """The next chunk of runs that nobody else does."""
        if self._alone:
            chunk = self._alone.popleft()
            self._running += len(chunk.jobs)
            return chunk
        while self._todo:
            taken = self.database.claim(self._batch())
            if taken:
                self._running += len(taken)
                self._tell()
                return self._chunk(taken)
        return None

    def _batch(self) -> list[int]:
        """The next runs of one problem that take about `CHUNK_S` together."""
        size = 1
        if self._own and self._cpu_s > 0.0:
            fair = len(self._todo) // (2 * max(1, self.executor.workers))
            size = min(int(CHUNK_S * self._own / self._cpu_s), MOST, fair)
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
            self._measures[problem],
            tuple(self._job(number) for number in numbers),
            self.plan.settings.responses,
            self.plan.time_limit_s,
        )

    def _job(self, number: int) -> Job:
        replicate, point = divmod(number, len(self.plan.points))
        at = self.plan.points[point]
        seed = self.plan.seeds[replicate]
        return Job(point, replicate, seed, at.algorithm, at.budget, at.engine)

    def _point(self, number: int) -> Point:
        return self.plan.points[number % len(self.plan.points)]

    def _take(self, chunk: Chunk, result: tuple[RunRecord, ...] | Lost) -> None:
        """Write what has ended. The runs of a chunk that was lost are tried one by one."""
        self._running -= len(chunk.jobs)
        if isinstance(result, Lost) and len(chunk.jobs) > 1:
            numbers = [job.replicate * len(self.plan.points) + job.point for job in chunk.jobs]
            self._alone.extend(self._chunk([number]) for number in numbers)
            return
        if isinstance(result, Lost):
            result = tuple(lost(job, result.reason, chunk.responses) for job in chunk.jobs)
        self.database.record(result)
        self._own += len(result)
        self._cpu_s += sum(run.cpu_s for run in result if not isnan(run.cpu_s))
        self._tell()

    def _key(self, *parts: str) -> str:
        """The name of a task: the same for the same part of the same study."""
        return hashlib.sha256("/".join((self._identity, *parts)).encode()).hexdigest()[:32]

    def _tell(self, note: str = "") -> None:
        if self._report is None:
            return
        done, failed = self.database.count(self.plan.total)
        seconds = time.monotonic() - self._start
        left = self.plan.total - done - failed
        remaining = seconds * left / self._own if self._own else None
        self._report(
            StudyProgress(done, self._running, failed, self.plan.total, seconds, remaining, note)
        )
