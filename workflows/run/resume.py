"""The state from which a run begins: a new one, or that in which it was interrupted."""

from __future__ import annotations

import tomllib
import zlib
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import numpy as np

from ...algorithms.checkpoint import Checkpoint
from ...algorithms.settings import Budget
from ...arrays import Array
from ...directory import Ownership
from ...errors import Fault, raise_all, refuse
from ...problems.tolerance_problem import ToleranceProblem
from ...section import differences, flat
from .plan import RunPlan

CHECKPOINT = "checkpoint.npz"
CONFIGURATION = "config.toml"
BUDGET = frozenset(f"algorithm.{name}" for name in ("generations", "evaluations", "time_limit_s"))
"""The keys that may differ between a run and the command that resumes it."""
SAME = 1e-6
"""Relative difference of values of a model up to which it is the same: that of other processors."""
AFTERWARDS = ("choice.", "rounding.")
"""Tables of what is done with the front after the search."""


def opened(plan: RunPlan, place: Ownership, resume: bool) -> Checkpoint:
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
    raise_all(_faults(checkpoint, plan) or _changed(checkpoint.model, model))
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


def _changed(before: Array, now: Array) -> list[Fault]:
    """A fault where a model has changed since the run was begun."""
    if before.shape == now.shape and np.allclose(before, now, rtol=SAME, atol=0.0, equal_nan=True):
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
    return faults + (_smaller(flat(old), flat(new)) if state is None else _shrunk(state, plan.budget))


def _smaller(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[Fault]:
    """A budget below that of a run which keeps no state: its results would be lost."""
    return [
        Fault(key, f"is {new[key]}, but the run to resume had {old[key]}: a budget may only grow")
        for key in sorted(BUDGET)
        if key in old and key in new and new[key] < old[key]
    ]


def _shrunk(state: Mapping[str, Any], budget: Budget) -> list[Fault]:
    """A budget that is less than what has been used."""
    used = {"generations": len(state["run.history"]), "evaluations": int(state["run.counts"][0])}
    return [
        Fault(
            f"algorithm.{name}", f"is {limit}, but the run to resume has already used {count}: a budget may only grow"
        )
        for name, count in used.items()
        if (limit := getattr(budget, name)) is not None and limit < count
    ]
