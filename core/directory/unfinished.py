"""The mark of a result that is being made or was interrupted: its files are not complete."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..sealed import read_record, write_record
from .names import is_output_file

UNFINISHED = "unfinished.json"


@dataclass(frozen=True, slots=True)
class Unfinished:
    """Which command began, under which token; `retiring` names files of an older result that it
    was removing.
    """

    command: str
    token: str
    retiring: tuple[str, ...] = ()


def write_unfinished(folder: Path, command: str, token: str, retiring: Sequence[str] = ()) -> Unfinished:
    """Mark a directory as one in which `command` has begun."""
    write_record(folder / UNFINISHED, {"command": command, "token": token, "retiring": list(retiring)})
    return Unfinished(command, token, tuple(retiring))


def read_unfinished(folder: Path) -> Unfinished | None:
    """The mark, None where there is none. Raises ValueError for a damaged one."""
    record = read_record(folder / UNFINISHED)
    if record is None:
        return None
    try:
        names = tuple(name for name in map(str, record["retiring"]) if _inside(name))
        return Unfinished(str(record["command"]), str(record["token"]), names)
    except (KeyError, TypeError) as error:
        raise ValueError(f"it is not the mark of a result ({error!r})") from error


def _inside(name: str) -> bool:
    """Whether it is the name of a result in the directory itself; other files are not removed."""
    path = Path(name)
    return not path.is_absolute() and ".." not in path.parts and is_output_file(path.name)
