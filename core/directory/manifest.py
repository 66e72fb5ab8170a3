"""The mark of a complete result: the SHA-256 of every file but pages and figures."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from ..errors import Fault
from ..files import is_file
from ..sealed import read_record, write_record
from .names import KINDS, present

MANIFEST = "manifest.json"
FORMAT = 1
ANEW = "restore the original file, or start again with --overwrite"
AS_IT_IS = "to show the files as they are, remove manifest.json"


@dataclass(frozen=True, slots=True)
class Manifest:
    """What a complete result is made of: the command, how it ended, and files with digests."""

    command: str
    status: str
    files: dict[str, str]


def write_manifest(folder: Path, command: str, status: str) -> None:
    """Mark what `command` has written as complete; the same files give the same bytes."""
    names = present(folder, KINDS[command].files)
    record = {
        "command": command,
        "status": status,
        "format": FORMAT,
        "version": version("tolevo"),
        "files": {name: digest(folder / name) for name in names},
    }
    write_record(folder / MANIFEST, record)


def read_manifest(folder: Path) -> Manifest | None:
    """The manifest of a directory, None where there is none. Raises ValueError where damaged."""
    record = read_record(folder / MANIFEST)
    if record is None:
        return None
    try:
        if record["format"] > FORMAT:
            raise ValueError(f"tolevo {record['version']} wrote it, which is newer: update tolevo")
        command = str(record["command"])
        if command not in KINDS:
            raise KeyError(command)
        return Manifest(command, str(record["status"]), dict(record["files"]))
    except (KeyError, TypeError) as error:
        raise ValueError(f"it is not the manifest of a result ({error!r})") from error


def strangers(folder: Path, manifest: Manifest, apart: Iterable[str] = ()) -> list[Fault]:
    """A fault for every file that does not belong to the result, except those in `apart`."""
    faults = []
    for name in present(folder, KINDS[manifest.command].files):
        text = ""
        if name not in manifest.files:
            text = f"does not belong to this result ({MANIFEST} does not list it): move it away"
        elif name not in apart and digest(folder / name) != manifest.files[name]:
            text = f"is not the file that this result was completed with (by {MANIFEST}): {ANEW}"
        if text and name not in apart:
            faults.append(Fault(f"{folder}/{name}", f"{text}; {AS_IT_IS}"))
    return faults


def digest(path: Path) -> str:
    """SHA-256 of a file, empty where it cannot be read."""
    if not is_file(path):
        return ""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""
