"""The work of a study in other processes: whole runs as tasks, their curves, and large Monte Carlos."""

from __future__ import annotations

import hashlib
import pickle
import shutil
import tempfile
import time
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from math import nan
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import parquet

from ...algorithms.archive import CURVE, Course
from ...algorithms.search import watch
from ...algorithms.settings import AlgorithmSettings, Budget
from ...errors import RunError
from ...execution import Closing, Executor, Lost, built, check_version, pinned
from ...models.propagation import ClippedSum, Estimate, MonteCarlo, Propagated
from ...problems.tolerance_problem import ToleranceProblem
from .plan import FORMULAS, Ended, Yardstick, response_by_reference, yardstick


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
        return tuple(_complete_run(job, problem, task) for job in task.jobs)


def _complete_run(job: Job, problem: ToleranceProblem, chunk: Chunk) -> RunRecord:
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
        record_of_end(job, "failed" if reason else "done", reason, chunk.responses),
        evaluations=course.evaluations,
        cpu_s=time.thread_time() - start,
        responses=responses,
        curve=curve,
    )


def record_of_end(job: Job, status: str, reason: str, responses: tuple[str, ...]) -> RunRecord:
    """The record of a run of which only the reason of its end is known."""
    unknown, curve = dict.fromkeys(responses, nan), np.empty((0, len(CURVE)))
    return RunRecord(job.point, job.replicate, job.seed, status, reason, 0, nan, unknown, curve)


def response_of(name: str, run: RunRecord, measure: Yardstick) -> float:
    """A response of a run by its reference, NaN where it has none."""
    value = run.responses[name]
    if run.status != "done" or not len(run.curve):
        return value
    return response_by_reference(name, value, float(run.curve[-1, CURVE.index("value")]), measure)


# The curves of a study in a Parquet file, a row group for each setting: never all in memory.


INTEGER_COLUMNS = ("point", "replicate", "generation", "evaluations")
SCHEMA = pa.schema(
    [(name, pa.int64() if name in INTEGER_COLUMNS else pa.float64()) for name in ("point", "replicate", *CURVE)]
)


class Curves(Closing):
    """One row per checkpoint of a run: point, replicate and `CURVE`.

    The file is a temporary one, which goes with this object; `copy_to` makes a lasting one. It can
    be read once it is closed: leave it as a context.
    """

    def __init__(self) -> None:
        folder = tempfile.mkdtemp(prefix="tolevo-curves-")
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        self._path = Path(folder, "curves.parquet")
        self._group: dict[int, int] = {}
        self._writer = parquet.ParquetWriter(self._path, SCHEMA)

    def close(self) -> None:
        """Nothing more is to be added."""
        self._writer.close()

    def add(self, point: int, runs: Sequence[RunRecord]) -> None:
        """The curves of the runs of one setting."""
        if len(frame := curves_of(runs)):
            self._group[point] = len(self._group)
            table = pa.Table.from_pandas(frame, schema=SCHEMA, preserve_index=False)
            self._writer.write_table(table, row_group_size=len(frame))

    def of(self, point: int) -> pd.DataFrame:
        """The curves of the runs of one setting, empty where there are none."""
        if point not in self._group:
            return curves_of(())
        with parquet.ParquetFile(self._path) as file:
            frame: pd.DataFrame = file.read_row_group(self._group[point]).to_pandas()
        return frame

    def copy_to(self, path: Path) -> None:
        """Write the whole file."""
        shutil.copyfile(self._path, path)


def curves_of(runs: Sequence[RunRecord]) -> pd.DataFrame:
    """The frame of the curves of runs."""
    lengths = [len(run.curve) for run in runs]
    values = np.concatenate([np.empty((0, len(CURVE))), *(run.curve for run in runs)])
    identity = {name: np.repeat([getattr(run, name) for run in runs], lengths) for name in ("point", "replicate")}
    frame = pd.DataFrame(identity | dict(zip(CURVE, values.T, strict=True)))
    return frame.astype(dict.fromkeys(INTEGER_COLUMNS, np.int64))


# A Monte Carlo too large for one process, in blocks that run where the runs of a study do.


SIZE = 2**20
"""Samples of a block: 65,536 in each of its scrambles."""


@dataclass(frozen=True, slots=True)
class Block:
    """A block: an independent sample, from a seed by its number, for all designs of `total`."""

    key: str
    number: int
    seed: np.random.SeedSequence
    samples: int
    total: ClippedSum
    coverage: float
    limit: float


def monte_carlo(
    total: ClippedSum, coverage: float, limit: float, samples: int, seed: int, executor: Executor, size: int = SIZE
) -> Propagated:
    """Statistics of `total` from at least `samples` units per design, as `Propagation.propagate`.

    Blocks of `size` units are seeded by their number, so that neither the executor nor the order in
    which they end changes a bit. The standard errors come from the scatter of the blocks; that of
    the quantile holds the bias of one block as well, which more blocks do not lessen.
    Raises RunError where a block is lost for good, ValueError for fewer than two blocks.
    """
    count = -(-samples // size)
    if count < 2:
        raise ValueError(f"samples must be more than one block of {size}, got {samples}")
    name = hashlib.sha256(pickle.dumps((total, coverage, limit, samples, seed, size))).hexdigest()
    blocks = (
        Block(f"{name[:24]}-{at}", at, part, size, total, coverage, limit)
        for at, part in enumerate(np.random.SeedSequence(seed).spawn(count))
    )
    by_number: dict[int, Propagated] = {}
    with executor:
        for block, result in executor.completed(propagate_block, lambda: next(blocks, None)):
            if isinstance(result, Lost):
                raise RunError(f"block {block.number} of the Monte Carlo: {result.reason}")
            by_number[block.number] = result
    return _average_blocks([by_number[at] for at in range(count)])


def propagate_block(block: Block) -> Propagated:
    """The statistics of one block."""
    dimensions = len(block.total.clipped) + len(block.total.free)
    with pinned():
        sample = MonteCarlo.draw(block.samples, dimensions, np.random.default_rng(block.seed))
        return sample.propagate(block.total, block.coverage, block.limit)


def _average_blocks(parts: list[Propagated]) -> Propagated:
    """Means over equal blocks."""
    estimates = {}
    for field in fields(Propagated):
        pieces = [getattr(part, field.name) for part in parts]
        if isinstance(pieces[0], Estimate):
            values = np.array([piece.value for piece in pieces])
            error = values.std(axis=0, ddof=1) / np.sqrt(len(values))
            if field.name == "quantile":
                error = error + 0.5 * np.mean([piece.error for piece in pieces], axis=0)
            estimates[field.name] = Estimate(values.mean(axis=0), error)
    first = parts[0]  # what is exact is the same in all
    return Propagated(first.geometric_mean, first.geometric_std, **estimates)
