"""The directory of a table's blocks: the table's identity, and the blocks that are computed."""

from __future__ import annotations

import fcntl
import hashlib
import os
import re
import shutil
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...errors import Fault, RunError, raise_all, refuse
from ...files import PART as LEFTOVER
from ...files import write_bytes
from ...sealed import read_record, write_record
from .store import About, BlockStore

PART = "part-{:06d}.parquet"
"""Name of a block: numbered by the rows in it, so that the names are in their order."""
ABOUT = "_table.json"
"""What the blocks belong to. Readers of Parquet directories leave out names with a `_`."""
LOG = "_parts.txt"
"""A line per block that is whole: its number and its digest."""
LOCK = "_lock"
LINE = re.compile(r"(\d+) ([0-9a-f]{64})\n")


class BlockFolder(BlockStore):
    """The blocks in `path`, of the table that `about` describes; one process at a time.

    With `resume` whole blocks that are there already are kept, and the rows of a block are those
    that they have. Raises InputError, which writes nothing, where the directory holds blocks of
    another table, or anything else.
    """

    def __init__(self, path: Path, about: About, resume: bool, overwrite: bool) -> None:
        self.path = path
        self.about = _agreed(path, about, resume, overwrite)
        if overwrite and path.exists():
            shutil.rmtree(path)
        path.mkdir(parents=True, exist_ok=True)
        self._lock = _locked(path)
        if not (path / ABOUT).exists():
            write_record(path / ABOUT, asdict(self.about))
        self.completed = self._intact_blocks()
        self._log = (path / LOG).open("a", encoding="utf-8")

    def keep(self, number: int, content: bytes) -> None:
        """Store a block: first its content, then the line that states that it is whole."""
        write_bytes(self.path / PART.format(number), content)
        self._log.write(f"{number} {hashlib.sha256(content).hexdigest()}\n")
        self._log.flush()
        os.fsync(self._log.fileno())
        self.completed.add(number)

    def block(self, number: int) -> Path:
        """The file of a block."""
        return self.path / PART.format(number)

    def saved(self) -> str:
        return f"{self._count(str(self.path))}; run the same command with --resume to continue"

    def close(self) -> None:
        if not self._log.closed:
            self._log.close()
            os.close(self._lock)

    def remove(self) -> None:
        for path in self.path.iterdir():  # the table's identity is removed last
            if path.name not in (ABOUT, LOCK):
                path.unlink()
        shutil.rmtree(self.path)
        self._log.close()
        os.close(self._lock)

    def _intact_blocks(self) -> set[int]:
        """Numbers of the blocks that are as they were written; a torn last line is cut off."""
        path, whole = self.path / LOG, set[int]()
        with suppress(FileNotFoundError):
            text = path.read_text(encoding="utf-8", errors="replace")
            lines = [line for line in text.splitlines(keepends=True) if LINE.fullmatch(line)]
            if "".join(lines) != text:
                write_bytes(path, "".join(lines).encode())
            for line in lines:
                number, digest = line.split()
                if _digest(self.block(int(number))) == digest:
                    whole.add(int(number))
        return whole


def _digest(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


def _agreed(path: Path, about: About, resume: bool, overwrite: bool) -> About:
    """The identity of the blocks: those that are there decide how many rows a block has."""
    raise_all(folder_faults(path, resume, overwrite))
    if overwrite or not path.exists() or _blank(path):
        return about
    try:
        stored: dict[str, Any] = read_record(path / ABOUT) or {}
    except ValueError as error:
        raise refuse("--resume", f"{path / ABOUT} cannot be read: {error}; give --overwrite") from error
    if others := " and of ".join(about.differences(stored)):
        raise refuse("--resume", f"{path} holds blocks of {others}; name another file, or give --overwrite")
    return about.with_blocks_of(stored)


def _blank(path: Path) -> bool:
    """Whether a directory holds nothing but the files of a process killed as it began."""
    return all(entry.name == LOCK or LEFTOVER.fullmatch(entry.name) for entry in path.iterdir())


def _locked(path: Path) -> int:
    """The lock of the directory, or an InputError where another process has it."""
    handle = os.open(path / LOCK, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        raise refuse("--out", f"{path} is being written by another process; wait for it") from None
    except OSError as error:
        os.close(handle)
        raise RunError(f"{path}: the file system has no locks ({error.strerror})") from error
    return handle


def folder_faults(path: Path, resume: bool, overwrite: bool) -> list[Fault]:
    """The reasons why a directory of blocks cannot be written, before anything is read."""
    if not path.exists() or (path.is_dir() and _blank(path)):
        return []
    if not path.is_dir():
        return [Fault("--out", f"{path} is a file; name a directory for --partitioned")]
    if not (path / ABOUT).exists():
        return [Fault("--out", f"{path} holds something other than a table in blocks; name another")]
    if resume or overwrite:
        return []
    return [Fault("--out", f"{path} holds blocks of an earlier command; continue with --resume, or --overwrite")]
