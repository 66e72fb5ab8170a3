"""Leftovers of killed processes: files that were being written, by their names."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path

from ..files import PART

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
