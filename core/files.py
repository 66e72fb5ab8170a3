"""Files: inputs are regular and of a limited size; outputs appear whole or not at all."""

from __future__ import annotations

import errno
import fcntl
import os
import re
import secrets
import select
import shutil
import stat
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from .counts import is_forced, size
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
KINDS = (
    (stat.S_ISREG, "a file"),
    (stat.S_ISDIR, "a directory"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISLNK, "a link"),
)
"""What a path may name other than a file, in words."""
CONFIGURATION = 8 * 2**20
"""Bytes of a configuration at most."""
TABLE = 2**30
"""Bytes of a table at most."""
SILENCE = 10.0
"""Time [s] within which something comes through a pipe."""
CHUNK = 2**16
LONGEST_NAME = 240
"""Bytes of a name at most: a part file has a longer one, and 255 is what file systems take."""
SHOWN = 60
"""Characters of a longer path that a message repeats."""
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


def content(path: Path, most: int = TABLE, pipe: bool = False) -> bytes:
    """The bytes of a regular file, or of a `pipe` where one is accepted.

    Raises ValueError, whose text says what keeps it from being read: it is no such file, or has
    more than `most` bytes.
    """
    if unreadable := not_a_file(path, most, pipe):
        raise ValueError(unreadable)
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb", buffering=0) as file:
            if stat.S_ISFIFO(os.fstat(handle).st_mode):
                return _through_pipe(handle, most)
            return file.read()
    except OSError as error:
        raise ValueError(f"cannot be read ({error.strerror})") from None


def not_a_file(path: Path, most: int = TABLE, pipe: bool = False) -> str:
    """Why a path cannot be read as a file of at most `most` bytes; empty where it can."""
    try:
        state = os.stat(path)
    except FileNotFoundError:
        return "is a link to nothing" if os.path.islink(path) else "does not exist"
    except (OSError, ValueError) as error:
        return f"cannot be read ({getattr(error, 'strerror', None) or error})"
    if not stat.S_ISREG(state.st_mode) and not (pipe and stat.S_ISFIFO(state.st_mode)):
        return f"is {_kind(state.st_mode)}; name a file"
    return _too_large(state.st_size, most)


def _through_pipe(handle: int, most: int) -> bytes:
    """All that comes through a pipe, whose writer may open it later."""
    poll, chunks, length = select.poll(), list[bytes](), 0
    poll.register(handle, select.POLLIN)
    while poll.poll(1000 * SILENCE):
        chunk = os.read(handle, CHUNK)
        if not chunk:
            return b"".join(chunks)
        chunks.append(chunk)
        length += len(chunk)
        if complaint := _too_large(length, most):
            raise ValueError(complaint)
    raise ValueError(f"is a pipe through which nothing came in {SILENCE:.0f} s")


def _too_large(length: int, most: int) -> str:
    if length <= most or is_forced():
        return ""
    return f"has {size(length)} or more, and {size(most)} is the most that is read: name another, or add --force"


def _kind(mode: int) -> str:
    return next((words for test, words in KINDS if test(mode)), "of an unknown kind")


def unwritable(path: Path, place: str, file: bool = False) -> list[Fault]:
    """A fault where nothing can be written at or below `path`, or where no `file` can be written
    at it: nothing but a regular file is ever replaced. Leaves no trace.
    """
    if obstacle := _obstacle(path, file):
        return [Fault(place, obstacle)]
    existing = path.parent if file else path
    while not os.path.lexists(existing) and existing != existing.parent:
        existing = existing.parent
    if not is_folder(existing):
        return [Fault(place, f"cannot be written: {existing} is not a directory; name another")]
    try:
        with tempfile.TemporaryFile(dir=existing) as probe:
            probe.write(b"\0" * PROBE)
        if not file or not is_file(path) or os.access(path, os.W_OK):
            return []
        return [Fault(place, f"{path} cannot be written: permission denied; change the permissions, or name another")]
    except OSError as error:
        reason, remedy = cause(error) or (error.strerror or "not writable", "")
        remedy = f"{remedy}, or " if remedy else ""
        return [Fault(place, f"cannot be written ({existing}: {reason}); {remedy}name another directory")]


def _obstacle(path: Path, file: bool) -> str:
    """Why nothing is written at a path because of its name or of what is there; empty otherwise."""
    name = str(path) if len(str(path)) <= LONGEST_NAME else f"{str(path)[:SHOWN]}..."
    if any(len(os.fsencode(part)) > LONGEST_NAME for part in path.parts):
        return f"{name} cannot be written: a name of more than {LONGEST_NAME} bytes is too long; name another"
    try:
        mode = os.lstat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        if not file or is_folder(path.parent):
            return ""
        missing = "is not a directory" if os.path.lexists(path.parent) else "does not exist"
        return f"the directory {path.parent} {missing}"
    except (OSError, ValueError) as error:
        return f"{name} cannot be written ({getattr(error, 'strerror', None) or error}); name another"
    if stat.S_ISLNK(mode) and (file or not is_folder(path)):
        return f"{name} is a link to {os.readlink(path)}: a link is not replaced; name what is meant itself, or another"
    if file and stat.S_ISDIR(mode):
        return f"{name} is a directory; name a file"
    if not file and not is_folder(path):
        return f"cannot be written: {name} is {_kind(mode)}, not a directory; name another"
    if file and not stat.S_ISREG(mode):
        return f"{name} is {_kind(mode)}, which is not replaced; name another file"
    return ""


def is_folder(path: Path) -> bool:
    """Whether a path, of whatever name, is that of a directory."""
    return os.path.isdir(path)  # that of Path raises where a name is too long


def is_file(path: Path) -> bool:
    """Whether a path, of whatever name, is that of a file."""
    return os.path.isfile(path)


def is_pipe(path: Path) -> bool:
    """Whether a path leads to a pipe."""
    try:
        return stat.S_ISFIFO(os.stat(path).st_mode)
    except (OSError, ValueError):
        return False


def _part(path: Path) -> Path:
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")


def _at(path: Path, error: OSError) -> OSError:
    """The error with the name of the file that was meant, not that of its part."""
    error.filename, error.filename2 = str(path), None
    return error
