"""The state of a directory: complete, unfinished, inconsistent, or without a mark."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from os.path import lexists
from pathlib import Path

from ..errors import Fault
from ..files import is_file, is_folder, not_a_file
from .lock import LOCK, holders
from .manifest import ANEW, AS_IT_IS, MANIFEST, Manifest, read_manifest, strangers
from .names import KINDS, folders, is_output_file, kind_of, present
from .parts import is_part
from .unfinished import UNFINISHED, Unfinished, read_unfinished

OWNERS = ".at-work-"
"""Beginning of the names of files by which processes that share a directory say that they live."""


@dataclass(frozen=True, slots=True)
class Standing:
    """The state of a directory.

    `command` is the command whose result it holds, empty where that is not known. A complete result
    has a manifest, an unfinished result has another mark; a directory with neither holds a result
    of an older version, or none. `faults` state which files do not belong together or cannot be
    read; such a directory may not be used. `missing` are files of a complete result that do not
    exist any more, `holders` the processes that work in it.
    """

    command: str = ""
    manifest: Manifest | None = None
    unfinished: Unfinished | None = None
    faults: tuple[Fault, ...] = ()
    missing: tuple[str, ...] = ()
    holders: str = ""
    seal: bytes = field(default=b"", repr=False)
    """The marks as bytes: equal as long as no command has begun or ended."""

    @property
    def complete(self) -> bool:
        """Whether it is a complete set of files that belong together."""
        return self.manifest is not None and not self.faults and not self.missing


def standing(folder: Path, apart: Iterable[str] = ()) -> Standing:
    """The state of a directory; the files in `apart` check themselves and are not tested."""
    if strange := irregular(folder):
        return Standing(faults=tuple(strange))
    busy, seal = holders(folder), seal_of(folder)
    faults: list[Fault] = []
    manifest = unfinished = None
    try:
        manifest = read_manifest(folder)
    except ValueError as error:
        faults.append(Fault(f"{folder}/{MANIFEST}", f"cannot be read: {error}; {ANEW}; {AS_IT_IS}"))
    if manifest is None and not faults:
        try:
            unfinished = read_unfinished(folder)
        except ValueError as error:
            faults.append(Fault(f"{folder}/{UNFINISHED}", f"cannot be read: {error}; start again with --overwrite"))
    mark = manifest or unfinished
    missing: tuple[str, ...] = ()
    if manifest is not None:
        faults += strangers(folder, manifest, tuple(apart))
        there = set(present(folder, KINDS[manifest.command].files))
        missing = tuple(name for name in manifest.files if name not in there)
    command = mark.command if mark is not None else kind_of(folder)
    return Standing(command, manifest, unfinished, tuple(faults), missing, busy, seal)


def irregular(folder: Path) -> list[Fault]:
    """A fault for every name of a result in a directory that is a device, a pipe, or another thing
    than a file.
    """
    marks, faults = (LOCK, MANIFEST, UNFINISHED), list[Fault]()
    for path in sorted(path for place in folders(folder) for path in place.iterdir()):
        named = path.name in marks or is_output_file(path.name)
        if named and not is_file(path) and lexists(path) and (why := not_a_file(path)):  # it may just have ended
            text = f"{why.partition(';')[0]}, no file of a result; move it away, or name another directory"
            faults.append(Fault(str(path), text))
    return faults


def not_whole(folder: Path) -> tuple[Fault, ...]:
    """Why a result must not be read: it is unfinished, or its files do not belong together."""
    here = standing(folder)
    if here.unfinished is None:
        return here.faults
    remedy = f"{here.holders} is at work on it: wait for it to end" if here.holders else ""
    remedy = remedy or "complete it by the same command with --resume"
    text = f"this result of `tolevo {here.command}` is unfinished: {remedy}, or name another directory"
    return (*here.faults, Fault(str(folder), text))


def seal_of(folder: Path) -> bytes:
    """The marks of a directory as bytes."""
    marks = []
    for name in (MANIFEST, UNFINISHED):
        try:
            marks.append((folder / name).read_bytes())
        except OSError:
            marks.append(b"")
    return b"\0".join(marks)


def occupied(folder: Path) -> bool:
    """Whether a directory holds anything, the traces of killed processes aside."""
    return is_folder(folder) and any(not is_trace(path.name) for path in folder.iterdir())


def is_trace(name: str) -> bool:
    """Whether a file is nothing but the lock or the leftover of a process."""
    return name == LOCK or name.startswith(OWNERS) or is_part(name, is_output_file)
