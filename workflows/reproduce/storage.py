"""Checked claims on disk, each whole or not at all, so that a broken reproduction can go on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from ...claim_records import ComputedTable
from ...directory import Ownership
from ...errors import Fault, InputError, raise_all, refuse
from ...sealed import read_record, write_record
from .task import Checked, ClaimTask
from .verdict import Outcome, Verdict, Word

TABLES = TypeAdapter(dict[str, ComputedTable])
FOLDER = "checked"
"""Folder below the output directory."""
LISTS = ("computed", "standard_error", "deviation")


def keep(folder: Path, task: ClaimTask, checked: Checked) -> None:
    """Write a checked claim."""
    (folder / FOLDER).mkdir(parents=True, exist_ok=True)
    record = {
        "key": task.key,
        "verdict": asdict(checked.verdict),
        "tables": TABLES.dump_python(dict(checked.tables), mode="json"),
    }
    write_record(_path(folder, task), record)


def read_checked(folder: Path, task: ClaimTask) -> Checked | None:
    """A claim that was checked before, None where it is not there or the claim has changed.

    Raises InputError where the file is not as it was written.
    """
    path = _path(folder, task)
    try:
        record = read_record(path)
        if record is None or record["key"] != task.key:
            return None
        return Checked(_read_verdict(record["verdict"]), TABLES.validate_python(record["tables"]))
    except (ValueError, KeyError, TypeError) as error:
        text = f"cannot be read: {error}; remove it, or start again with --overwrite"
        raise refuse(str(path), text) from error


def all_kept(folder: Path, tasks: Iterable[ClaimTask]) -> dict[str, Checked]:
    """Every claim that was checked before, by its key. Raises InputError with all damaged ones."""
    checked_claims, faults = dict[str, Checked](), list[Fault]()
    for task in tasks:
        try:
            checked = read_checked(folder, task)
        except InputError as error:
            faults += error.faults
        else:
            checked_claims |= {} if checked is None else {task.key: checked}
    raise_all(faults)
    return checked_claims


def files_of(folder: Path, tasks: Iterable[ClaimTask]) -> list[str]:
    """Names of the files of claims, relative to the output directory."""
    return [_path(folder, task).relative_to(folder).as_posix() for task in tasks]


def holds_another(place: Ownership) -> bool:
    """Whether a directory holds something, and that is no reproduction."""
    return not place.blank and not (place.folder / FOLDER).is_dir()


def _path(folder: Path, task: ClaimTask) -> Path:
    return folder / FOLDER / f"{task.document}_{task.number}.json"


def _read_verdict(record: Mapping[str, Any]) -> Verdict:
    outcomes = tuple(_read_outcome(outcome) for outcome in record["outcomes"])
    return Verdict(Word(record["word"]), record["reason"], outcomes, record["shown"])


def _read_outcome(record: Mapping[str, Any]) -> Outcome:
    computed, error, deviation = (tuple(record[name]) for name in LISTS)
    return Outcome(record["states"], record["by"], computed, error, deviation, record["holds"])
