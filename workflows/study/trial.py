"""Whole runs as tasks: pure functions of their arguments, which any process can compute."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from math import nan

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
    """The task of computing the yardstick of a pickled problem."""

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


def done(task: Chunk | Surveying) -> tuple[RunRecord, ...] | Yardstick:
    """The yardstick of a problem, or the runs of a chunk one after the other, on one thread."""
    check_version(task.version)
    with pinned():
        problem: ToleranceProblem = built(task.problem)
        if isinstance(task, Surveying):
            return yardstick(problem)
        return tuple(_completed(job, problem, task) for job in task.jobs)


def _completed(job: Job, problem: ToleranceProblem, chunk: Chunk) -> RunRecord:
    """A run to its end; any error in it is the reason why it failed, but an interrupt is not."""
    start, reason = time.thread_time(), ""
    course = Course(chunk.measure.box, chunk.measure.level)
    curve, responses = np.empty((0, len(CURVE))), dict.fromkeys(chunk.responses, nan)
    try:
        watch(problem, job.algorithm, job.budget, job.seed, course, job.engine, chunk.limit_s)
        curve = course.curve()
        run = Ended(problem, course, chunk.measure)
        responses = {name: float(FORMULAS[name](run)) for name in chunk.responses}
    except Exception as error:
        lines = str(error).strip().splitlines()
        reason = f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__
    return replace(
        ended(job, "failed" if reason else "done", reason, chunk.responses),
        evaluations=course.evaluations,
        cpu_s=time.thread_time() - start,
        responses=responses,
        curve=curve,
    )


def ended(job: Job, status: str, reason: str, responses: tuple[str, ...]) -> RunRecord:
    """The record of a run of which only the reason of its end is known."""
    unknown, curve = dict.fromkeys(responses, nan), np.empty((0, len(CURVE)))
    return RunRecord(job.point, job.replicate, job.seed, status, reason, 0, nan, unknown, curve)


def response_of(name: str, run: RunRecord, measure: Yardstick) -> float:
    """A response of a run by its reference, NaN where it has none."""
    value = run.responses[name]
    if run.status != "done" or not len(run.curve):
        return value
    return compared(name, value, float(run.curve[-1, CURVE.index("value")]), measure)
