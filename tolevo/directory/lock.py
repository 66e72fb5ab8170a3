"""The only owner of a directory: a lock on a file in it, held as long as the process lives.

The kernel releases the lock when the process ends, however it ends, so that a killed process leaves
no lock; the file alone means nothing.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
import socket
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any, TypeVar

from ..files import PART

LOCK = ".tolevo-lock"
OTHER = "another process"
PATIENCE = 0.3
"""Time [s] within which another process has finished testing the lock."""
STEP = 0.02
Outcome = TypeVar("Outcome")


class Held(Exception):
    """The directory has another owner; the text says who."""


class Lock:
    """The lock on a directory, of one process or shared with others that do the same."""

    def __init__(self, path: Path, handle: int, exclusive: bool, command: str) -> None:
        self.path = path
        self.exclusive = exclusive
        self.command = command
        self._handle: int | None = handle
        self._sign()

    def share(self) -> None:
        """Share the lock with others. Raises Held where another process took it meanwhile."""
        handle = self._handle
        if handle is None or not self.exclusive:
            return
        self.exclusive = False
        if not patient(lambda: _flock(handle, fcntl.LOCK_SH) or None):
            self._let_go()
            raise Held(holders(self.path.parent) or OTHER)

    def exclude(self, patience: float) -> None:
        """Wait until no process shares any more. Raises Held where that takes longer."""
        if self.exclusive:
            return
        self._let_go()  # two processes that both kept it would wait for each other
        taken = acquire(self.path.parent, self.command, patience=patience)
        self._handle, taken._handle, self.exclusive = taken._handle, None, True

    def holds(self) -> bool:
        """Whether the lock is still that of the directory, and not of one that was removed."""
        try:
            return self._handle is not None and os.path.samestat(os.fstat(self._handle), os.stat(self.path))
        except OSError:
            return False

    def release(self) -> None:
        """Release the lock; its last holder removes the file."""
        handle = self._handle
        if handle is not None and self.holds() and (self.exclusive or _flock(handle, fcntl.LOCK_EX)):
            self.path.unlink(missing_ok=True)
        self._let_go()

    def _let_go(self) -> None:
        if self._handle is not None:
            os.close(self._handle)
        self._handle = None

    def _sign(self) -> None:
        """Write who holds the lock, for processes that are refused."""
        entry = {
            "command": self.command,
            "pid": os.getpid(),
            "host": socket.gethostname(),
            "since": datetime.now().astimezone().isoformat(timespec="seconds"),
        }
        handle = self._handle
        assert handle is not None
        if self.exclusive:
            os.ftruncate(handle, 0)
        os.lseek(handle, 0, os.SEEK_END)
        with suppress(OSError):  # on a full disk the lock holds without its entry
            os.write(handle, json.dumps(entry).encode() + b"\n")


def acquire(folder: Path, command: str, sharing: Callable[[], bool] | None = None, patience: float = PATIENCE) -> Lock:
    """The lock on `folder` for a `tolevo <command>`, shared only where `sharing` allows it.

    Raises Held where another process has it, OSError where no file can be made there.
    """
    path = folder / LOCK

    def attempt() -> Lock | None:
        if (handle := hold(path, fcntl.LOCK_EX)) is not None:
            return Lock(path, handle, True, command)
        if sharing is not None and (handle := hold(path, fcntl.LOCK_SH)) is not None:
            if sharing():
                return Lock(path, handle, False, command)
            os.close(handle)
        return None

    lock = patient(attempt, patience)
    if lock is None:
        raise Held(holders(folder) or OTHER)
    return lock


def hold(path: Path, kind: int) -> int | None:
    """A handle on `path` with a lock on it, None where another process holds a lock.

    The file is made where there is none. A file that its last holder removed meanwhile does not
    count: the next process would lock another file.
    """
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            if not _flock(handle, kind):
                os.close(handle)
                return None
            same = os.path.samestat(os.fstat(handle), os.stat(path))
        except FileNotFoundError:
            same = False
        except BaseException:
            os.close(handle)
            raise
        if same:
            return handle
        os.close(handle)


def is_held(path: Path) -> bool:
    """Whether a living process has a lock on that file."""
    if not os.path.isfile(path):
        return False
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError:
        return False
    try:
        return not _flock(handle, fcntl.LOCK_EX)
    except OSError:  # a file system that locks only what can be written
        return False
    finally:
        os.close(handle)


def holders(folder: Path) -> str:
    """The processes that work in a directory, in words; empty where there are none."""
    if not is_held(folder / LOCK):
        return ""
    return " and ".join(map(_words, _entries(folder))) or OTHER


def commands(folder: Path) -> set[str]:
    """The commands of those who work in a directory, as far as they have signed."""
    return {entry["command"] for entry in _entries(folder)}


def _entries(folder: Path) -> list[dict[str, Any]]:
    """What the living holders have signed with."""
    with suppress(OSError, ValueError):
        lines = (folder / LOCK).read_text(encoding="utf-8").splitlines()
        return [entry for entry in map(json.loads, lines) if _alive(entry)]
    return []


def patient(attempt: Callable[[], Outcome | None], seconds: float = PATIENCE) -> Outcome | None:
    """What `attempt` returns; while it is None, it is tried again for so many seconds."""
    until = time.monotonic() + seconds
    while (outcome := attempt()) is None and time.monotonic() < until:
        time.sleep(STEP)
    return outcome


def _flock(handle: int, kind: int) -> bool:
    try:
        fcntl.flock(handle, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _alive(entry: dict[str, Any]) -> bool:
    """Whether the process may live; of another machine nothing is known."""
    if entry["host"] != socket.gethostname():
        return True
    try:
        os.kill(int(entry["pid"]), 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass
    return True


def _words(entry: dict[str, Any]) -> str:
    return f"`tolevo {entry['command']}` (process {entry['pid']} on {entry['host']}, since {entry['since']})"


# Leftovers of killed processes: files that were being written, by their names.


OLDER = re.compile(r"\.(?P<name>.+)\.[a-z0-9_]{8}")
"""As earlier versions named them."""


def is_part(name: str, known: Callable[[str], bool]) -> bool:
    """Whether a file or folder is the beginning of one that is `known`."""
    match = PART.fullmatch(name) or OLDER.fullmatch(name)
    return match is not None and known(match["name"])


def sweep(folders: Iterable[Path], known: Callable[[str], bool]) -> None:
    """Remove the leftovers in directories that no other process writes into."""
    for folder in folders:
        for path in folder.iterdir():
            if not is_part(path.name, known):
                continue
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)
