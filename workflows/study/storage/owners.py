"""Which processes work on a study: each holds a lock on a file of its own, as long as it lives.

The directory itself is shared by them (`tolevo.directory`); these say whose claims still count.
SQLite's write-ahead log needs all processes on one machine anyway.
"""

from __future__ import annotations

import fcntl
import os
import secrets
from pathlib import Path

from ....directory.lock import hold, is_held
from ....directory.standing import OWNERS as PREFIX


class Owner:
    """The claim of this process to be alive, in the folder of the study."""

    def __init__(self, folder: Path) -> None:
        self.name = f"{os.getpid()}-{secrets.token_hex(4)}"
        self._path = folder / f"{PREFIX}{self.name}"
        handle = hold(self._path, fcntl.LOCK_EX)
        assert handle is not None  # the name is its own
        self._handle = handle

    def close(self) -> None:
        """Say that this process works no more."""
        self._path.unlink(missing_ok=True)
        os.close(self._handle)


def alive(folder: Path, name: str) -> bool:
    """Whether the process with that name still works on the study; clears up after a dead one."""
    path = folder / f"{PREFIX}{name}"
    if is_held(path):
        return True
    path.unlink(missing_ok=True)
    return False
