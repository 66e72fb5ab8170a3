"""The state from which a run begins: a new one, or that in which it was interrupted."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from typing import Any

from ...algorithms.checkpoint import Checkpoint
from ...algorithms.settings import Budget
from ...directory import Ownership
from ...errors import Fault, raise_all, refuse
from ...section import flat
from .plan import RunPlan

CHECKPOINT = "checkpoint.npz"
CONFIGURATION = "config.toml"
BUDGET = frozenset(f"algorithm.{name}" for name in ("generations", "evaluations", "time_limit_s"))
"""The keys that may differ between a run and the command that resumes it."""
AFTERWARDS = ("choice.", "rounding.")
"""Tables of what is done with the front after the search."""


def opened(plan: RunPlan, place: Ownership, resume: bool) -> Checkpoint:
    """The checkpoint of a run: the stored one where the run is resumed, else a new one.

    Raises InputError where what is there is not the same run, or has no checkpoint.
    """
    path = place.folder / CHECKPOINT
    if not resume or place.blank:
        return Checkpoint(path, plan.configuration)
    if not path.is_file():
        text = f"{place.folder} holds no {CHECKPOINT} of a run; name another directory, or --overwrite"
        raise refuse("--resume", text)
    checkpoint = Checkpoint.read(path)
    raise_all(_faults(checkpoint, plan))
    checkpoint.identity = plan.configuration
    return checkpoint


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
    old, new = flat(tomllib.loads(checkpoint.identity)), flat(tomllib.loads(plan.configuration))
    faults = [
        Fault(
            key,
            f"is {_shown(new, key)}, but the run to resume has {_shown(old, key)}: only the "
            "budget may differ; undo the change, or start again with --overwrite",
        )
        for key in dict.fromkeys([*new, *old])
        if not key.startswith(AFTERWARDS) and key not in BUDGET and new.get(key) != old.get(key)
    ]
    state = checkpoint.saved()
    return faults + (_smaller(old, new) if state is None else _shrunk(state, plan.budget))


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


def _shown(values: Mapping[str, Any], key: str) -> str:
    return f'"{values[key]}"' if isinstance(values.get(key), str) else str(values.get(key, "unset"))
