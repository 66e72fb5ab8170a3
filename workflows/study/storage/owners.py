"""Which processes work on a study: each holds a lock on a file of its own, as long as it lives.

The kernel lets go of the lock when the process ends, however it ends. SQLite's write-ahead log
needs all processes on one machine anyway.
"""

from __future__ import annotations

import fcntl
import os
import secrets
from pathlib import Path

PREFIX = ".at-work-"


class Owner:
    """The claim of this process to be alive, in the folder of the study."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.name = f"{os.getpid()}-{secrets.token_hex(4)}"
        self._path = folder / f"{PREFIX}{self.name}"
        self._file = self._path.open("wb")
        fcntl.flock(self._file, fcntl.LOCK_EX)

    def close(self) -> None:
        """Say that this process works no more."""
        self._path.unlink(missing_ok=True)
        self._file.close()


def alive(folder: Path, name: str) -> bool:
    """Whether the process with that name still works on the study; clears up after a dead one."""
    path = folder / f"{PREFIX}{name}"
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            path.unlink(missing_ok=True)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    return False


def at_work(folder: Path) -> list[str]:
    """Names of the processes that work on the study in a folder."""
    found = sorted(path.name.removeprefix(PREFIX) for path in folder.glob(f"{PREFIX}*"))
    return [name for name in found if alive(folder, name)]
