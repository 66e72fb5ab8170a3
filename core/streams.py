"""Standard streams that are closed or not read any more: a command goes on without them."""

from __future__ import annotations

import errno
import io
import os
import sys
from typing import Any

LIBRARIES = ("numpy", "scipy", "pandas", "sklearn", "statsmodels", "numba")
LOST = (errno.EPIPE, errno.EIO)
"""Errors of a pipe whose reader has ended, and of a terminal that is gone."""


class Unread(io.FileIO):
    """A stream whose text is dropped once its reader is gone; other errors are raised."""

    def write(self, data: Any) -> int:
        """Bytes that were written, or dropped."""
        try:
            return super().write(data) or 0
        except OSError as error:
            if error.errno not in LOST:
                raise
            return memoryview(data).nbytes


def keep_standard_streams() -> None:
    """Let stdout and stderr end without an error where their reader does.

    A stream that was closed before the start is opened on the null device: otherwise the next file
    would get its number, and the output of a library would end up in that file.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    if sys.stdout is sys.__stdout__:  # else they lead elsewhere
        sys.stdout = _over(1, sys.stdout, line_buffering=sys.stdout is not None and sys.stdout.isatty())
    if sys.stderr is sys.__stderr__:
        sys.stderr = _over(2, sys.stderr, line_buffering=True)


def warn_in_a_line(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
    """Print a warning of a model or a plugin without the place in the code; none of a library about
    its numbers, whose results are tested by those who use them.
    """
    library = category.__module__.partition(".")[0] in LIBRARIES
    if not library and not issubclass(category, RuntimeWarning):
        print(f"warning: {message}", file=sys.stderr, flush=True)


def _over(number: int, before: io.TextIOWrapper | Any, line_buffering: bool) -> io.TextIOWrapper:
    """A text stream over a file descriptor, with the encoding of the one that it replaces."""
    encoding, errors = getattr(before, "encoding", "utf-8"), getattr(before, "errors", "replace")
    raw = io.BufferedWriter(Unread(number, "w", closefd=False))
    return io.TextIOWrapper(raw, encoding, errors, line_buffering=line_buffering)
