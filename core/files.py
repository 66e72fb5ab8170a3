"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from .errors import Fault


def write_bytes(path: Path, content: bytes) -> None:
    """Write `content` beside `path` and move it there in one step."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def write_text(path: Path, content: str) -> None:
    """`write_bytes` of UTF-8 text."""
    write_bytes(path, content.encode())


def write_with(path: Path, writer: Callable[[Path], object]) -> None:
    """Let `writer` write a file of its own (Parquet, PNG), then move it to `path` in one step."""
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
        part = Path(folder) / path.name
        writer(part)
        os.replace(part, path)


def unwritable(path: Path, place: str) -> list[Fault]:
    """A fault where nothing can be written at or below `path`; leaves no trace."""
    found = path
    while not found.exists() and found != found.parent:
        found = found.parent
    if not found.is_dir():
        return [Fault(place, f"cannot be written: {found} is not a directory; name another")]
    try:
        with tempfile.TemporaryFile(dir=found):
            return []
    except OSError as error:
        reason = error.strerror or "not writable"
        return [Fault(place, f"cannot be written ({found}: {reason}); name another directory")]
