"""Files that appear whole or not at all."""

from __future__ import annotations

import errno
import fcntl
import os
import re
import secrets
import shutil
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from .errors import Fault

REASONS = {
    errno.ENOSPC: ("the disk is full", "make room"),
    errno.EDQUOT: ("the disk quota is used up", "make room within the quota"),
    errno.EROFS: ("the file system is read-only", "make it writable"),
    errno.EACCES: ("permission denied", "change the permissions"),
    errno.EPERM: ("permission denied", "change the permissions"),
    errno.EFBIG: ("the file would be larger than is allowed", "raise the limit (ulimit -f)"),
    errno.EIO: ("the disk reports an error", "check the disk"),
    errno.ENOLCK: ("the file system has no locks", "use a local disk"),
    errno.ENOSYS: ("the file system has no locks", "use a local disk"),
    errno.EOPNOTSUPP: ("the file system has no locks", "use a local disk"),
}
"""Why a file cannot be written, and what helps, by the number of the error."""
PART = re.compile(r"\.(?P<name>.+)\.[0-9a-f]{8}\.part")
"""Names of files that are being written."""
PROBE = 4096
"""Bytes that must fit where something is to be written."""


def write_bytes(path: Path, content: bytes) -> None:
    """Write `content` next to `path` and move it there in one step; the umask is kept."""
    part = _part(path)
    try:
        handle = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        with os.fdopen(handle, "wb") as file:
            with suppress(OSError):  # a file system without locks
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # else it is a leftover
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
            os.replace(part, path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise _at(path, error) from None
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def write_text(path: Path, content: str) -> None:
    """`write_bytes` of UTF-8 text."""
    write_bytes(path, content.encode())


def write_with(path: Path, writer: Callable[[Path], object]) -> None:
    """Let `writer` write a file of its own, then move it to `path` in one step."""
    folder = _part(path)
    try:
        folder.mkdir()
        writer(folder / path.name)
        with (folder / path.name).open("rb") as file:
            os.fsync(file.fileno())
        os.replace(folder / path.name, path)
    except OSError as error:
        raise _at(path, error) from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def clear_parts(path: Path) -> None:
    """Remove leftovers of killed processes of `path`; a file that is being written stays."""
    for part in path.parent.glob(f".{path.name}.*.part"):
        if not part.is_file() or not PART.fullmatch(part.name):
            continue
        with suppress(OSError), part.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            part.unlink(missing_ok=True)


def cause(error: OSError) -> tuple[str, str] | None:
    """Why something cannot be written, and what helps; None for errors of another kind."""
    return REASONS.get(error.errno or 0)


def unwritable(path: Path, place: str) -> list[Fault]:
    """A fault where nothing can be written at or below `path`; leaves no trace."""
    existing = path
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir():
        return [Fault(place, f"cannot be written: {existing} is not a directory; name another")]
    try:
        with tempfile.TemporaryFile(dir=existing) as file:
            file.write(b"\0" * PROBE)
        return []
    except OSError as error:
        reason, remedy = cause(error) or (error.strerror or "not writable", "")
        remedy = f"{remedy}, or " if remedy else ""
        return [Fault(place, f"cannot be written ({existing}: {reason}); {remedy}name another directory")]


def is_folder(path: Path) -> bool:
    """Whether a path, of whatever name, is that of a directory."""
    return os.path.isdir(path)  # that of Path raises where a name is too long


def is_file(path: Path) -> bool:
    """Whether a path, of whatever name, is that of a file."""
    return os.path.isfile(path)


def _part(path: Path) -> Path:
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")


def _at(path: Path, error: OSError) -> OSError:
    """The error with the name of the file that was meant, not that of its part."""
    error.filename, error.filename2 = str(path), None
    return error
