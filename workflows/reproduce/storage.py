"""Checked claims on disk, each whole or not at all, so that a reproduction can be resumed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

from pydantic import TypeAdapter

from ...claim_records import ComputedTable
from ...directory import Ownership
from ...errors import Fault, InputError, raise_all, refuse
from ...sealed import read_record, write_record
from .task import Checked, ClaimTask
from .verdict import Verdict

TABLES = TypeAdapter(dict[str, ComputedTable])
VERDICT = TypeAdapter(Verdict)
FOLDER = "checked"
"""Folder below the output directory."""


def keep(folder: Path, task: ClaimTask, checked: Checked) -> None:
    """Write a checked claim."""
    (folder / FOLDER).mkdir(exist_ok=True)
    tables = TABLES.dump_python(dict(checked.tables), mode="json")
    write_record(_path(folder, task), {"key": task.key, "verdict": asdict(checked.verdict), "tables": tables})


def read_checked(folder: Path, task: ClaimTask) -> Checked | None:
    """A claim that was checked before, None where it is not there or the claim has changed.

    Raises InputError where the file is not as it was written.
    """
    path = _path(folder, task)
    try:
        record = read_record(path)
        if record is None or record["key"] != task.key:
            return None
        return Checked(VERDICT.validate_python(record["verdict"]), TABLES.validate_python(record["tables"]))
    except (ValueError, KeyError, TypeError) as error:
        raise refuse(str(path), f"cannot be read: {error}; remove it, or start again with --overwrite") from error


def all_kept(folder: Path, tasks: Iterable[ClaimTask]) -> dict[str, Checked]:
    """Every claim that was checked before, by its key. Raises InputError with all damaged ones."""
    checked_claims, faults = dict[str, Checked](), list[Fault]()
    for task in tasks:
        try:
            checked = read_checked(folder, task)
        except InputError as error:
            faults += error.faults
            continue
        if checked is not None:
            checked_claims[task.key] = checked
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
