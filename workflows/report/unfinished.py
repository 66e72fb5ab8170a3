"""The saved part of a result that is being computed, or was interrupted."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd

from ...algorithms.checkpoint import Checkpoint
from ...directory import KINDS, Standing
from ...directory.names import present
from ...errors import InputError
from ...sealed import read_record
from ..gap.replicates import FILE as REPLICATES
from ..run.resume import CHECKPOINT
from ..study.records import RESPONSES
from ..study.storage.site import site_of

COLUMNS = ["generation", "evaluations", "seconds", "hypervolume", "feasible_fraction"]
"""Columns of the history in the checkpoint of a run."""


def remark_of(here: Standing) -> str:
    """The remark on a directory that is not finished, or in use; empty for others."""
    if here.unfinished is None:
        return f"is complete, but {here.holders} is at work here" if here.holders else ""
    if here.holders:
        return f"is missing: this result is unfinished, {here.holders} is at work on it"
    return (
        f"is missing: this result of `tolevo {here.command}` is unfinished; run the same "
        "command with --resume to continue"
    )


def course(folder: Path) -> pd.DataFrame | None:
    """The convergence of a run as far as its search was saved, None where it was not."""
    path = folder / CHECKPOINT
    if not path.is_file():
        return None
    try:
        state = Checkpoint.read(path).saved()
    except InputError:
        return None
    return None if state is None else pd.DataFrame(state["run.history"], columns=COLUMNS)


def facts(folder: Path, here: Standing) -> tuple[str, ...]:
    """What has been saved, in sentences."""
    if here.unfinished is not None and here.unfinished.retiring:
        return ("An older result was being replaced; nothing of the new one was saved.",)
    if here.command == "study":
        runs = _runs(folder)
        return (f"{len(runs)} runs have ended." if len(runs) else "No run has ended.",)
    state = present(folder, KINDS[here.command].state) if here.command in KINDS else []
    if not state:
        return ("Nothing has been saved.",)
    if here.command == "gap":
        lines = (folder / state[0]).read_bytes().count(b"\n") - 1
        return (f"{max(lines, 0)} replicates have ended.",)
    if here.command == "reproduce":
        return (f"{len(state)} claims have been checked.",)
    return ("No generation has been saved.",)


def tables(folder: Path, here: Standing) -> dict[str, pd.DataFrame]:
    """The results so far, by title: responses of a study by setting, claims by verdict, effects in
    the replicates of a gap analysis.
    """
    if here.unfinished is not None and here.unfinished.retiring:
        return {}
    builders = {"study": _responses, "reproduce": _checked, "gap": _replicates}
    return builders[here.command](folder) if here.command in builders else {}


def _responses(folder: Path) -> dict[str, pd.DataFrame]:
    """Median of every response over the runs that have ended, by point of the design."""
    runs = _runs(folder)
    names = [name for name in RESPONSES if name in runs and runs[name].notna().any()]
    if runs.empty or not names:
        return {}
    medians = runs.groupby("point")[names].median()
    medians.insert(0, "runs ended", runs.groupby("point").size())
    return {"Medians so far, by point of the design": medians.reset_index()}


def _checked(folder: Path) -> dict[str, pd.DataFrame]:
    """Claims that have been checked, with their verdicts."""
    rows = []
    for name in present(folder, KINDS["reproduce"].state):
        try:
            record = read_record(folder / name)
        except ValueError:
            continue
        verdict = record.get("verdict") if isinstance(record, dict) else None
        if isinstance(verdict, dict):
            stated = {"verdict": str(verdict.get("word", "")), "reason": str(verdict.get("reason", ""))}
            rows.append({"claim": Path(name).stem} | stated)
    return {"Claims checked so far": pd.DataFrame(rows)} if rows else {}


def _replicates(folder: Path) -> dict[str, pd.DataFrame]:
    """Effects identified in the replicates of a bootstrap that have ended, and their estimates."""
    values: dict[tuple[str, str], list[float]] = {}
    named: dict[str, int] = {}
    ended = 0
    path = folder / REPLICATES
    for line in path.read_text(encoding="utf-8").splitlines() if path.is_file() else ():
        try:
            effects = json.loads(line)["effects"]
        except (ValueError, KeyError, TypeError):  # its first line, or an incomplete line
            continue
        ended += 1
        for effect, numbers in effects.items():
            named[effect] = named.get(effect, 0) + 1
            for parameter, value in numbers.items():
                values.setdefault((effect, parameter), []).append(float(value))
    rows = [
        {"effect": effect, "named in [%]": 100.0 * named[effect] / ended, "parameter": parameter}
        | dict(zip(("5 %", "median", "95 %"), np.quantile(estimates, (0.05, 0.5, 0.95)), strict=True))
        for (effect, parameter), estimates in values.items()
    ]
    title = f"Effects in the {ended} replicates so far; the answer follows when all have ended"
    return {title: pd.DataFrame(rows)} if rows else {}


def _runs(folder: Path) -> pd.DataFrame:
    """The runs of a study that have ended, with their responses; none where nothing can be read."""
    from sqlalchemy import select

    from ..store.backend import DAMAGE, Foreign, Newer
    from ..store.store import Store
    from ..store.tables import RUNS

    columns = [RUNS.c.point, *(RUNS.c[name] for name in RESPONSES)]
    try:
        with Store(site_of(folder).backend(reading=True), reading=True) as store:
            rows = store.read(lambda connection: connection.execute(select(*columns)).all())
    except (*DAMAGE, Foreign, Newer, InputError):
        rows = []
    return pd.DataFrame([tuple(row) for row in rows], columns=[column.name for column in columns])
