"""Files: inputs are regular and of a limited size; outputs appear whole or not at all."""

from __future__ import annotations

import errno
import fcntl
import hashlib
import json
import os
import re
import secrets
import select
import shutil
import stat
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np
from numpy.typing import NDArray

from .errors import Fault
from .section import is_forced, size

if TYPE_CHECKING:
    import pandas as pd

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
WORKBOOK = "stack.xlsx"
"""The workbook of a configuration with its result, in the directory of the result."""
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
        raise _error_at(path, error) from None
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
        raise _error_at(path, error) from None
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
    if unreadable := file_obstacle(path, most, pipe):
        raise ValueError(unreadable)
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb", buffering=0) as file:
            if stat.S_ISFIFO(os.fstat(handle).st_mode):
                return _through_pipe(handle, most)
            return file.read()
    except OSError as error:
        raise ValueError(f"cannot be read ({error.strerror})") from None


def file_obstacle(path: Path, most: int = TABLE, pipe: bool = False) -> str:
    """Why a path cannot be read as a file of at most `most` bytes; empty where it can."""
    try:
        state = os.stat(path)
    except FileNotFoundError:
        return "is a link to nothing" if os.path.islink(path) else "does not exist"
    except (OSError, ValueError) as error:
        return f"cannot be read ({getattr(error, 'strerror', None) or error})"
    if not stat.S_ISREG(state.st_mode) and not (pipe and stat.S_ISFIFO(state.st_mode)):
        return f"is {_kind(state.st_mode)}; name a file"
    return _size_message(state.st_size, most)


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
        if complaint := _size_message(length, most):
            raise ValueError(complaint)
    raise ValueError(f"is a pipe through which nothing came in {SILENCE:.0f} s")


def _size_message(length: int, most: int) -> str:
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


def _error_at(path: Path, error: OSError) -> OSError:
    """The error with the name of the file that was meant, not that of its part."""
    error.filename, error.filename2 = str(path), None
    return error


# Text of CSV files in which no spreadsheet finds a formula, and the same files read again.
#
# A spreadsheet computes a cell that begins with `=`, `+`, `-` or `@`, even a name from a table of
# the user's. An apostrophe in front makes it text. Numbers stay as they are.


_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:inf|nan)"
_NUMBERS = re.compile(rf"(?:{_NUMBER})(?:; (?:{_NUMBER}))*")
"""One number or several, as in the table of claims."""
_ACTIVE = re.compile(r"'*[=+\-@\t\r]")
"""How a formula begins, or a text that has apostrophes in front of such a beginning already."""
_MARKED = re.compile(r"'+[=+\-@\t\r]")


def csv_text(frame: pd.DataFrame, header: bool = True) -> str:
    """A table without its index as CSV: LF line ends, and no cell or name that is a formula.

    Without its `header` it continues a file that has a header.
    """
    names = [neutralise_cell(name) for name in frame.columns]
    return _change_texts(frame, neutralise_cell).to_csv(
        index=False, lineterminator="\n", header=names if header else False
    )


def exact_reading() -> dict[str, Any]:
    """Options with which pandas reads every number as it was written; before 3.1 the last digit of some was lost."""
    import pandas as pd

    return {} if tuple(map(int, pd.__version__.split(".")[:2])) >= (3, 1) else {"float_precision": "round_trip"}


def read_own_csv(path: Path | TextIO) -> pd.DataFrame:
    """A CSV table that `csv_text` wrote, every text and number as it was.

    Raises OSError where the file cannot be read, ValueError where it is not a table.
    """
    import pandas as pd

    table = _change_texts(pd.read_csv(path, **exact_reading()), restore_cell)
    return table.set_axis([restore_cell(name) for name in table.columns], axis="columns")


def neutralise_cell(cell: Any) -> Any:
    """A cell that is text to a spreadsheet: with an apostrophe if it would be a formula."""
    if not isinstance(cell, str) or not _ACTIVE.match(cell) or _NUMBERS.fullmatch(cell):
        return cell
    return f"'{cell}"


def restore_cell(cell: Any) -> Any:
    """The argument of `neutralise_cell`, from its result."""
    return cell[1:] if isinstance(cell, str) and _MARKED.match(cell) else cell


def restore_cells(cells: NDArray[Any]) -> NDArray[Any]:
    """`restore_cell` of every cell."""
    changed = _change_cells(cells, restore_cell)
    return cells if changed is None else changed


def _change_texts(frame: pd.DataFrame, change: Callable[[Any], Any]) -> pd.DataFrame:
    """The table with the changed texts; the table itself where none changes."""
    columns = {at: _change_cells(frame.iloc[:, at].to_numpy(), change) for at in range(frame.shape[1])}
    changed = {at: cells for at, cells in columns.items() if cells is not None}
    table = frame.copy() if changed else frame
    for at, cells in changed.items():
        table.isetitem(at, cells)
    return table


def _change_cells(cells: NDArray[Any], change: Callable[[Any], Any]) -> NDArray[Any] | None:
    """The changed cells of a column; None where none changes."""
    if cells.dtype.kind not in "OUT":
        return None
    texts = {cell for cell in cells if isinstance(cell, str)}
    changed = {text: new for text in texts if (new := change(text)) != text}
    if not changed:
        return None
    column = np.empty(len(cells), dtype=object)
    column[:] = [changed.get(cell, cell) if isinstance(cell, str) else cell for cell in cells]
    return column


# Content that carries its own digest, so that damage is detected before it is used.


MARK = b"\nsha256 "
"""Before the digest, which ends the content."""
KEY = "sha256"
"""Key of the digest of a record."""
LENGTH = len(MARK) + 64 + 1


def seal_content(content: bytes) -> bytes:
    """The content with its SHA-256 at its end."""
    return content + _seal(content)


def unseal_content(content: bytes) -> bytes:
    """What `seal_content` was given. Raises ValueError where a byte is not as it was written."""
    body, seal = content[:-LENGTH], content[-LENGTH:]
    if not seal.startswith(MARK):
        raise ValueError("it is cut short, or of another version: it does not end with its digest")
    if seal != _seal(body):
        raise ValueError("it is damaged: its content does not fit its digest")
    return body


def seal_record(record: Mapping[str, Any], of: str = "") -> dict[str, Any]:
    """A record of JSON values with its digest as the last entry, bound to the text `of`."""
    return {**record, KEY: digest_of(record, of)}


def unseal_record(stored: Any, of: str = "") -> dict[str, Any]:
    """What `seal_record` was given. Raises ValueError where a value is another."""
    if not isinstance(stored, dict) or KEY not in stored:
        raise ValueError("it is not a record with a digest")
    record = {name: value for name, value in stored.items() if name != KEY}
    if stored[KEY] != digest_of(record, of):
        raise ValueError("it is damaged: its content does not fit its digest")
    return record


def write_record(path: Path, record: Mapping[str, Any]) -> None:
    """Write a sealed record as a JSON file."""
    write_text(path, json.dumps(seal_record(record), indent=1) + "\n")


def read_record(path: Path) -> dict[str, Any] | None:
    """What `write_record` was given, None where there is no file. Raises ValueError if damaged."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except OSError as error:
        raise ValueError(error.strerror) from error
    return unseal_record(loads(text))


def digest_of(record: Mapping[str, Any], of: str = "") -> str:
    """SHA-256 of a record of JSON values, whatever the order of its names."""
    text = json.dumps(record, sort_keys=True)
    return hashlib.sha256(f"{of}\n{text}".encode()).hexdigest()


def loads(text: str | bytes) -> Any:
    """A JSON value. Raises ValueError for any other text."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deep") from None


def _seal(body: bytes) -> bytes:
    return MARK + hashlib.sha256(body).hexdigest().encode() + b"\n"
