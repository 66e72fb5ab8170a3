"""The front of a run: reported from its archive, its alternatives, workers, and resumed state."""

from __future__ import annotations

import pickle
import secrets
import tomllib
import zlib
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...algorithms.archive import MIN_KEPT_DESIGNS, lowest_ranks, nondominated
from ...algorithms.checkpoint import Checkpoint
from ...algorithms.exact.bounds import restrict_form
from ...algorithms.exact.choices import least_cost
from ...algorithms.run import ResultT, TaskT
from ...algorithms.search import SearchResult
from ...algorithms.settings import Budget
from ...directory import Ownership
from ...errors import Fault, raise_all, refuse
from ...execution import (
    Background,
    Closing,
    Execution,
    Executor,
    Lost,
    Processes,
    built,
    check_version,
    executor_of,
    next_of,
    pinned,
)
from ...problems.tolerance_problem import ToleranceProblem, designs_of
from ...section import Array, differences, flat
from .plan import RunPlan

EXACT, ROBUST = "exact, least cost within the limits", "least worst regret"
"""Labels of the exact optimum and of the allocation of least worst regret among the references."""
MAX_SAMPLED_CANDIDATES = 100
"""Designs recomputed at most where every design is tested on a sample of fresh units."""
MAX_CANDIDATES = 20_000
"""Designs recomputed at full accuracy at most."""


def reported_front(problem: ToleranceProblem, result: SearchResult, searching: bool = False) -> pd.DataFrame:
    """The non-dominated feasible points of the archive, every value at full accuracy, or as `searching` sees it.

    The search may have ranked by a coarser propagation, so the best ranks are recomputed and
    filtered again; only the remaining designs are verified. Sorted by the objectives; empty where
    no point is feasible.
    """
    if not searching:
        problem.release(of_searches=True)
    candidates = result.chosen if len(result.chosen) else result.x[_candidates(problem, result)]
    whole, designs = problem if searching else problem.reported(), problem.complete(candidates)
    values = whole.outputs_of(designs, searching, errors=False) if len(designs) else {}
    rows = _nondominated_rows(whole, designs, values) if len(designs) else np.arange(0)
    if not len(rows):
        return pd.DataFrame(columns=[*problem.names, *(o.name for o in problem.outputs)])
    frame = whole.frame(designs[rows], {name: column[rows] for name, column in values.items()}, searching)
    names = list(problem.objectives)
    frame = frame.drop(columns="feasible").sort_values(names, kind="stable")
    frame = frame.reset_index(drop=True)
    frame["knee"] = knee(frame[names].to_numpy())
    return frame


def _nondominated_rows(problem: ToleranceProblem, designs: Array, values: Mapping[str, Array]) -> NDArray[np.int64]:
    """Rows of the feasible designs that no other feasible one dominates."""
    finite = np.isfinite(problem.objective_values(values)).all(axis=1)
    rows = np.flatnonzero(finite & np.all(problem.violations(designs, values) <= 0.0, axis=1))
    return rows[nondominated(problem.objective_values(values)[rows])] if len(rows) else rows


def _candidates(problem: ToleranceProblem, result: SearchResult) -> NDArray[np.int64]:
    """Rows of the archive that may be on the front; more than the most are thinned evenly."""
    room, most = (
        (MAX_SAMPLED_CANDIDATES, MAX_SAMPLED_CANDIDATES)
        if problem.declaration.sampled
        else (MIN_KEPT_DESIGNS, MAX_CANDIDATES)
    )
    rows = lowest_ranks(result.x, result.f, room)
    if len(rows) <= most:
        return rows
    order = rows[np.lexsort(result.f[rows].T[::-1])]
    return np.sort(order[np.linspace(0, len(order) - 1, most).astype(np.int64)])


def nearest_miss(problem: ToleranceProblem, result: SearchResult) -> pd.DataFrame:
    """The evaluated design with the least total violation, at full accuracy (one row).

    That of the tightest tolerances where none was evaluated, as where it was proven before that none can keep the
    limits.
    """
    designs = problem.complete(result.miss) if len(result.miss) else problem.corner(tight=True)[None, :]
    return problem.reported().frame(designs)


def knee(values: Array) -> NDArray[np.bool_]:
    """Marks the point farthest below the chord between the ends of a two-objective front."""
    marked = np.zeros(len(values), dtype=bool)
    if values.shape[1] != 2 or len(values) < 3:
        return marked
    span = values.max(axis=0) - values.min(axis=0)
    scaled = (values - values.min(axis=0)) / np.where(span > 0.0, span, 1.0)
    marked[int(np.argmin(scaled.sum(axis=1)))] = True
    return marked


def middle_point(front: pd.DataFrame) -> pd.Series[Any]:
    """The point in the middle of a front by cost."""
    order = front["cost"].astype(float).argsort(kind="stable")
    return front.iloc[int(order.iloc[len(front) // 2])]


def exact_label(problem: ToleranceProblem) -> str:
    """The label of the exact optimum: of the cost, or of the column that is minimised in its place."""
    return EXACT if problem.priced == "cost" else EXACT.replace("cost", problem.priced)


def join_references(
    front: pd.DataFrame, references: pd.DataFrame, problem: ToleranceProblem
) -> tuple[pd.DataFrame, int, int]:
    """The front joined with the references within reach, without the points that they dominate.

    A reference can join where it meets all limits and lies in the search space; the exact optimum
    and the allocation of least worst regret do not take the place of the one point of a single-objective
    run. Returns the front, the number of points removed and the number of references joined.
    """
    if problem.n_obj == 1 and len(references):
        references = references[~references["label"].isin([exact_label(problem), ROBUST])]
    if not len(references):
        return front, 0, 0
    names = list(problem.objectives)
    eligible = references[references["feasible"].astype(bool) & rows_in_range(references, problem)]
    eligible = eligible.drop(columns=["label", "feasible", "violated_limits"], errors="ignore")
    eligible = eligible.assign(knee=False)
    merged = pd.concat([front, eligible]) if len(front) else eligible
    remaining = nondominated(merged[names].to_numpy())
    joined = int(remaining[len(front) :].sum())
    merged = merged[remaining].sort_values(names, kind="stable").reset_index(drop=True)
    whole = {v.name: "int64" for v in problem.variables if v.integer and not v.labels}
    merged = merged.astype(whole)
    merged["knee"] = knee(merged[names].to_numpy())
    return merged, len(front) - int(remaining[: len(front)].sum()), joined


def rows_in_range(references: pd.DataFrame, problem: ToleranceProblem) -> NDArray[np.bool_]:
    """Which rows lie in the search ranges and have the fixed values."""
    bounds = {v.name: (problem.xl[i], problem.xu[i]) for i, v in enumerate(problem.free)}
    bounds |= {name: (value, value) for name, value in problem.fixed.items()}
    designs = designs_of(problem, references)
    low, high = np.array([bounds[name] for name in problem.names]).T
    return np.asarray(np.all((designs >= low) & (designs <= high), axis=1))


# What the alternatives of a machine would cost: equal reducers everywhere, calibrated or not.


MIN_DIFFERENCE_PERCENT = 1e-3
"""Difference [percent] below which two costs count as equal: bounds and points differ by less."""


def alternatives(problem: ToleranceProblem, front: pd.DataFrame) -> list[dict[str, Any]]:
    """The least cost at the point in the middle of the front by cost, for the problem and for each
    of its alternatives, at the point's values of all objectives and limited outputs.

    Empty where a problem has no alternatives, or where its least cost is not proven.
    """
    others = problem.alternatives()
    if front.empty or not others:
        return []
    row = middle_point(front)
    base_cost = _least(problem, problem, row)
    if base_cost is None:
        return []
    costs = [(label, _least(alternative, problem, row)) for label, alternative in others.items()]
    return [
        {
            "label": label,
            "cost": cost,
            "this": base_cost,
            "more_percent": round(100.0 * (cost / base_cost - 1.0), 9) + 0.0,
        }
        for label, cost in costs
        if cost is not None
    ]


def sentences(rows: list[dict[str, Any]]) -> tuple[str, ...]:
    """The alternatives in sentences."""
    messages = []
    for row in rows:
        if abs(row["more_percent"]) < MIN_DIFFERENCE_PERCENT:
            messages.append(f"{row['label']}: costs the same at equal R and equal other requirements")
            continue
        side = "more" if row["more_percent"] >= 0.0 else "less"
        messages.append(
            f"{row['label']}: the least cost of the point in the middle of the front would be {row['cost']:.4g} "
            f"instead of {row['this']:.4g}, {abs(row['more_percent']):.3g} % {side}, at equal R and equal other "
            "requirements"
        )
    return tuple(messages)


def _least(problem: ToleranceProblem, asked: ToleranceProblem, row: pd.Series[Any]) -> float | None:
    """Least cost of a problem at a row's values of the goals and limits of `asked`, or None."""
    form = problem.form()
    if form is None:
        return None
    names = {*asked.objectives, *(limit.name for limit in asked.limits)}
    limits = np.array(
        [float(row[name]) if {name, form.stands.get(name, "")} & names else np.inf for name in form.outputs]
    )
    used = np.isfinite(limits)
    if not np.any(used):
        return None
    optimum = least_cost(restrict_form(form, used), limits[None, used] * (1.0 + 1e-9))
    return float(optimum.cost[0]) if np.isfinite(optimum.cost[0]) else None


# The designs of the main search, evaluated by an executor as well where workers are free.


@dataclass(frozen=True, slots=True)
class Part:
    """A task of a search, by its place `at`: `function` of the pickled problem and an argument."""

    key: str
    version: str
    problem: bytes
    at: int
    function: Callable[[ToleranceProblem, Any], Any]
    argument: Any


def computed(part: Part) -> Any:
    """The result of a part of a search."""
    check_version(part.version)
    with pinned():
        return part.function(built(part.problem), part.argument)


class Designs(Closing):
    """Shares the parts of a search with other processes; this one computes what none has begun.

    `free` returns how many processes are available now in addition to this one; more are started when
    the number rises, and are used once they have computed a task. They end when the context is
    left.
    """

    def __init__(self, problem: ToleranceProblem, where: Execution, free: Callable[[], int]) -> None:
        self.problem, self.where, self.free = problem, where, free
        self._name = secrets.token_hex(8)
        self._content = b""
        self._batches = 0
        self._executor: Executor | None = None
        self._starting: tuple[Processes, Background[Part, Any]] | None = None
        self._ahead: tuple[Processes, Background[Part, Any]] | None = None

    def close(self) -> None:
        """End all other processes."""
        for begun in (self._starting, self._ahead):
            if begun is not None:
                begun[1].close()
        if self._executor is not None:
            self._executor.close()

    @property
    def executor(self) -> Executor | None:
        """The other processes, None where none has started."""
        self._take_started()
        return self._executor

    @property
    def helpers(self) -> int:
        """Processes, or workers of a scheduler, that take part in addition to this process."""
        return 0 if self._executor is None else self._executor.workers

    def ahead(self, function: Callable[[ToleranceProblem, TaskT], ResultT], task: TaskT) -> Callable[..., ResultT]:
        """What returns `function(problem, task)` later: another process begins with it, and takes part afterwards.

        Called with a value it does not wait, and returns that where the result is not there yet.
        """
        self._ahead = self._begun(1, function, [task])
        background, known = self._ahead[1], list[ResultT]()

        def result(*meanwhile: ResultT) -> ResultT:
            if not meanwhile:
                background.wait()
            if background.over and not known:
                known.extend(found for _, found in background.taken() if not isinstance(found, Lost))
            if not known and not meanwhile:  # it was lost
                known.append(function(self.problem, task))
            return (*known, *meanwhile)[0]

        return result

    def results(self, function: Callable[[ToleranceProblem, TaskT], ResultT], tasks: Sequence[TaskT]) -> list[ResultT]:
        """`function(problem, task)` of each task; that of a lost worker is computed here."""
        self._batches += 1
        self._start(function, tasks[0])
        if self._executor is None:
            return [function(self.problem, task) for task in tasks]
        parts = deque(self._parts(function, tasks))
        results: dict[int, ResultT] = {}
        background = Background(self._executor, computed, partial(next_of, parts))
        while (part := next_of(parts)) is not None:
            results[part.at] = function(self.problem, part.argument)
        background.wait()
        while pairs := background.taken():
            for part, result in pairs:
                if isinstance(result, Lost):
                    results[part.at] = function(self.problem, part.argument)
                else:
                    results[part.at] = result
        return [results[at] for at in range(len(tasks))]

    def _parts(self, function: Callable[[ToleranceProblem, Any], Any], tasks: Sequence[Any]) -> list[Part]:
        if not self._content:
            self._content = pickle.dumps(self.problem)
        name, installed = f"{self._name}-{self._batches}", version("tolevo")
        return [Part(f"{name}-{at}", installed, self._content, at, function, task) for at, task in enumerate(tasks)]

    def _start(self, function: Callable[[ToleranceProblem, Any], Any], task: Any) -> None:
        """Start processes where some are free, and take those that have started."""
        if self.where.dask:
            self._executor = self._executor or executor_of(self.where)
            return
        self._take_started()
        free = self.free() - (self._ahead is not None)
        if self._starting is None and free > self.helpers:
            self._starting = self._begun(free, function, [task] * free)

    def _take_started(self) -> None:
        """Take the processes that have ended their first task, in the place of those that take part."""
        if self._starting is not None and self._starting[1].over:
            begun, first = self._starting
            first.taken()
            if self._executor is not None:
                self._executor.close()
            self._executor, self._starting = begun, None
        if self._ahead is not None and self._ahead[1].over:
            begun, self._ahead = self._ahead[0], None
            if self._executor is None and self._starting is None:
                self._executor = begun
            else:
                begun.close()

    def _begun(
        self, free: int, function: Callable[[ToleranceProblem, Any], Any], tasks: Sequence[Any]
    ) -> tuple[Processes, Background[Part, Any]]:
        """So many processes, with tasks for the first of them."""
        processes, parts = Processes(free), deque(self._parts(function, tasks))
        return processes, Background(processes, computed, partial(next_of, parts))


# The state from which a run begins: a new one, or that in which it was interrupted.


CHECKPOINT = "checkpoint.npz"
CONFIGURATION = "config.toml"
BUDGET = frozenset(f"algorithm.{name}" for name in ("generations", "evaluations", "time_limit_s"))
"""The keys that may differ between a run and the command that resumes it."""
MODEL_TOLERANCE = 1e-6
"""Relative difference of values of a model up to which it is the same: that of other processors."""
AFTERWARDS = ("choice.", "rounding.")
"""Tables of what is done with the front after the search."""


def open_checkpoint(plan: RunPlan, place: Ownership, resume: bool) -> Checkpoint:
    """The checkpoint of a run: the stored one where the run is resumed, else a new one.

    Raises InputError where what is there is not the same run, or has no checkpoint.
    """
    path, model = place.folder / CHECKPOINT, _model(plan.problem)
    if not resume or place.blank:
        checkpoint = Checkpoint(path, plan.configuration)
        checkpoint.model = model
        return checkpoint
    if not path.is_file():
        text = f"{place.folder} holds no {CHECKPOINT} of a run; name another directory, or --overwrite"
        raise refuse("--resume", text)
    checkpoint = Checkpoint.read(path)
    raise_all(_faults(checkpoint, plan) or _model_change_fault(checkpoint.model, model))
    checkpoint.identity = plan.configuration
    return checkpoint


def _model(problem: ToleranceProblem) -> Array:
    """The version and values of the model at three designs, by which a changed model is detected."""
    whole = np.array([variable.integer for variable in problem.free], dtype=bool)
    middle = 0.5 * (problem.xl + problem.xu)
    x = np.stack([problem.xl, np.where(whole, np.floor(middle), middle), problem.xu])
    values = problem.outputs_of(problem.complete(x), searching=True)
    columns = [np.asarray(values[output.name], dtype=float) for output in problem.outputs]
    return np.concatenate([[float(zlib.crc32(version("tolevo").encode()))], *columns])


def _model_change_fault(before: Array, now: Array) -> list[Fault]:
    """A fault where a model has changed since the run was begun."""
    if before.shape == now.shape and np.allclose(before, now, rtol=MODEL_TOLERANCE, atol=0.0, equal_nan=True):
        return []
    text = "gives other values than in the run to resume, as another version or a changed file does; start again with "
    return [Fault("problem", f"{text}--overwrite")]


def seconds_before(checkpoint: Checkpoint) -> float:
    """Time [s] that the search had used when its state was saved."""
    state = checkpoint.saved()
    return 0.0 if state is None else float(state["run.counts"][1])


def notes_of(checkpoint: Checkpoint, resume: bool) -> tuple[str, ...]:
    """What the user should know of a resumed run."""
    if not (resume and checkpoint.unsavable):
        return ()
    return ("the state of this algorithm cannot be saved: its search starts again from the beginning",)


def _faults(checkpoint: Checkpoint, plan: RunPlan) -> list[Fault]:
    old, new = tomllib.loads(checkpoint.identity), tomllib.loads(plan.configuration)
    faults = [
        Fault(
            key,
            f"is {now}, but the run to resume has {was}: only the budget may differ; undo the change, or start "
            "again with --overwrite",
        )
        for key, (was, now) in differences(old, new).items()
        if not key.startswith(AFTERWARDS) and key not in BUDGET
    ]
    state = checkpoint.saved()
    return faults + (
        _smaller_budget_fault(flat(old), flat(new)) if state is None else _exhausted_budget_fault(state, plan.budget)
    )


def _smaller_budget_fault(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[Fault]:
    """A budget below that of a run which keeps no state: its results would be lost."""
    return [
        Fault(key, f"is {new[key]}, but the run to resume had {old[key]}: a budget may only grow")
        for key in sorted(BUDGET)
        if key in old and key in new and new[key] < old[key]
    ]


def _exhausted_budget_fault(state: Mapping[str, Any], budget: Budget) -> list[Fault]:
    """A budget that is less than what has been used."""
    used = {"generations": len(state["run.history"]), "evaluations": int(state["run.counts"][0])}
    return [
        Fault(
            f"algorithm.{name}", f"is {limit}, but the run to resume has already used {count}: a budget may only grow"
        )
        for name, count in used.items()
        if (limit := getattr(budget, name)) is not None and limit < count
    ]
