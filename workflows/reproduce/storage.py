"""Checked claims on disk, each whole or not at all, so that a broken reproduction can go on."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from ...claim_records import ComputedTable
from ...files import write_text
from .task import Checked, ClaimTask
from .verdict import Outcome, Verdict, Word

TABLES = TypeAdapter(dict[str, ComputedTable])
FOLDER = "checked"
"""Folder below the output directory."""
LISTS = ("computed", "standard_error", "deviation")


def keep(folder: Path, task: ClaimTask, checked: Checked) -> None:
    """Write a checked claim."""
    (folder / FOLDER).mkdir(parents=True, exist_ok=True)
    found = {
        "key": task.key,
        "verdict": asdict(checked.verdict),
        "tables": TABLES.dump_python(dict(checked.tables), mode="json"),
    }
    write_text(_path(folder, task), json.dumps(found, indent=1) + "\n")


def kept(folder: Path, task: ClaimTask) -> Checked | None:
    """A claim that was checked before, None where it is not there or anything has changed."""
    try:
        found = json.loads(_path(folder, task).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(found, dict) or found.get("key") != task.key:
        return None
    return Checked(_read_verdict(found["verdict"]), TABLES.validate_python(found["tables"]))


def clear(folder: Path, tasks: Iterable[ClaimTask] = ()) -> None:
    """Remove every checked claim but those of `tasks`."""
    kept_ = {_path(folder, task) for task in tasks}
    for path in (folder / FOLDER).glob("*.json"):
        if path not in kept_:
            path.unlink()


def holds_another(folder: Path) -> bool:
    """Whether a directory holds something, and that is no reproduction."""
    return folder.is_dir() and any(folder.iterdir()) and not (folder / FOLDER).is_dir()


def _path(folder: Path, task: ClaimTask) -> Path:
    return folder / FOLDER / f"{task.document}_{task.number}.json"


def _read_verdict(found: Mapping[str, Any]) -> Verdict:
    outcomes = tuple(_read_outcome(one) for one in found["outcomes"])
    return Verdict(Word(found["word"]), found["reason"], outcomes, found["shown"])


def _read_outcome(found: Mapping[str, Any]) -> Outcome:
    computed, error, deviation = (tuple(found[name]) for name in LISTS)
    return Outcome(found["states"], found["by"], computed, error, deviation, found["holds"])
