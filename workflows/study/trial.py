"""Whole runs as tasks: pure functions of their arguments, which any process can compute."""

from __future__ import annotations

import time
from dataclasses import dataclass
from math import nan
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from ...algorithms.course import CURVE, Course
from ...algorithms.settings import AlgorithmSettings, Budget
from ...algorithms.watched import watch
from ...problems.tolerance_problem import ToleranceProblem
from ..execution import built, check_version, pinned
from .responses import FORMULAS, Ended, compared
from .yardstick import Yardstick, yardstick


@dataclass(frozen=True, slots=True)
class Job:
    """One run: where it stands in the study, its seed and its settings."""

    point: int
    replicate: int
    seed: int
    algorithm: AlgorithmSettings
    budget: Budget
    engine: str


@dataclass(frozen=True, slots=True)
class Chunk:
    """Some runs of one problem, which is pickled; `version` is that of the sender.

    `key` names the task: equal keys are equal tasks.
    """

    key: str
    version: str
    problem: bytes
    measure: Yardstick
    jobs: tuple[Job, ...]
    responses: tuple[str, ...]
    limit_s: float | None


@dataclass(frozen=True, slots=True)
class Surveying:
    """The task of finding the yardstick of a pickled problem."""

    key: str
    version: str
    problem: bytes
    number: int


@dataclass(frozen=True, slots=True, eq=False)
class RunRecord:
    """A run that has ended, "done" or "failed" with its reason; the curve has columns `CURVE`."""

    point: int
    replicate: int
    seed: int
    status: str
    reason: str
    evaluations: int
    cpu_s: float
    responses: dict[str, float]
    curve: NDArray[np.float64]


class Guarded:
    """A context in which any error is caught and kept in `reason`; an interrupt is not."""

    def __init__(self) -> None:
        self.reason = ""

    def __enter__(self) -> Guarded:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        if not isinstance(error, Exception):
            return False
        lines = str(error).strip().splitlines()
        self.reason = f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__
        return True


def done(task: Chunk | Surveying) -> tuple[RunRecord, ...] | Yardstick:
    """The result of a task of a study."""
    return perform(task) if isinstance(task, Chunk) else survey(task)


def perform(chunk: Chunk) -> tuple[RunRecord, ...]:
    """Run the jobs of a chunk, one after the other, on one thread."""
    check_version(chunk.version)
    with pinned():
        problem: ToleranceProblem = built(chunk.problem)
        return tuple(run_one(job, problem, chunk) for job in chunk.jobs)


def survey(task: Surveying) -> Yardstick:
    """The yardstick of a problem."""
    check_version(task.version)
    with pinned():
        return yardstick(built(task.problem))


def run_one(job: Job, problem: ToleranceProblem, chunk: Chunk) -> RunRecord:
    """One run; whatever goes wrong in it is its reason to have failed."""
    start = time.thread_time()
    course = Course(chunk.measure.box, chunk.measure.level)
    curve, responses = np.empty((0, len(CURVE))), dict.fromkeys(chunk.responses, nan)
    with Guarded() as guard:
        watch(problem, job.algorithm, job.budget, job.seed, course, job.engine, chunk.limit_s)
        curve = course.curve()
        ended = Ended(problem, course, chunk.measure)
        responses = {name: float(FORMULAS[name](ended)) for name in chunk.responses}
    return RunRecord(
        job.point,
        job.replicate,
        job.seed,
        "failed" if guard.reason else "done",
        guard.reason,
        course.evaluations,
        time.thread_time() - start,
        responses,
        curve,
    )


def crash_record(job: Job, reason: str, responses: tuple[str, ...]) -> RunRecord:
    """The record of a run that took its process with it."""
    return ended(job, "failed", reason, responses)


def ended(job: Job, status: str, reason: str, responses: tuple[str, ...]) -> RunRecord:
    """The record of a run of which only the reason of its end is known."""
    return RunRecord(
        job.point,
        job.replicate,
        job.seed,
        status,
        reason,
        0,
        nan,
        dict.fromkeys(responses, nan),
        np.empty((0, len(CURVE))),
    )


def response_of(name: str, run: RunRecord, measure: Yardstick) -> float:
    """A response of a run by its reference, NaN where it has none."""
    value = run.responses[name]
    if run.status != "done" or not len(run.curve):
        return value
    return compared(name, value, float(run.curve[-1, CURVE.index("value")]), measure)
