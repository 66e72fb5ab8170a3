"""The only owner of a directory: a lock on a file in it, held as long as the process lives.

The kernel releases the lock when the process ends, however it ends, so that a killed process leaves
no lock; the file alone means nothing.
"""

from __future__ import annotations

import fcntl
import json
import os
import socket
import time
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any

LOCK = ".tolevo-lock"
UNKNOWN_HOLDER = "another process"
PATIENCE = 0.3
"""Time [s] within which another process has finished testing the lock."""
STEP = 0.02


class Held(Exception):
    """The directory has another owner; the text says who."""


class Lock:
    """The lock on a directory, signed by the command that holds it."""

    def __init__(self, path: Path, handle: int, command: str) -> None:
        self.path = path
        self.command = command
        self._handle: int | None = handle
        self._sign()

    def holds(self) -> bool:
        """Whether the lock is still that of the directory, and not of one that was removed."""
        try:
            return self._handle is not None and os.path.samestat(os.fstat(self._handle), os.stat(self.path))
        except OSError:
            return False

    def release(self) -> None:
        """Release the lock, and remove its file."""
        if self.holds():
            self.path.unlink(missing_ok=True)
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
        os.ftruncate(handle, 0)
        with suppress(OSError):  # on a full disk the lock holds without its entry
            os.write(handle, json.dumps(entry).encode() + b"\n")


def acquire(folder: Path, command: str) -> Lock:
    """The lock on `folder` for a `tolevo <command>`.

    Raises Held where another process has it, OSError where no file can be made there.
    """
    until = time.monotonic() + PATIENCE
    while (handle := hold(folder / LOCK)) is None:
        if time.monotonic() >= until:
            raise Held(holders(folder) or UNKNOWN_HOLDER)
        time.sleep(STEP)
    return Lock(folder / LOCK, handle, command)


def hold(path: Path) -> int | None:
    """A handle on `path` with a lock on it, None where another process holds it.

    The file is made where there is none. A file that its last holder removed meanwhile does not
    count: the next process would lock another file.
    """
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            if not _flock(handle):
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
        return not _flock(handle)
    except OSError:  # a file system that locks only what can be written
        return False
    finally:
        os.close(handle)


def holders(folder: Path) -> str:
    """The processes that work in a directory, in words; empty where there are none."""
    if not is_held(folder / LOCK):
        return ""
    return " and ".join(map(_words, _entries(folder))) or UNKNOWN_HOLDER


def _entries(folder: Path) -> list[dict[str, Any]]:
    """What the living holders have signed with."""
    with suppress(OSError, ValueError):
        lines = (folder / LOCK).read_text(encoding="utf-8").splitlines()
        return [entry for entry in map(json.loads, lines) if _may_be_alive(entry)]
    return []


def _flock(handle: int) -> bool:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _may_be_alive(entry: dict[str, Any]) -> bool:
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
