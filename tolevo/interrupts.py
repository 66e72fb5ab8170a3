"""Interrupts of a command: Ctrl-C, SIGTERM and SIGHUP end it with one line and status 130.

While a command has nothing to save it ends at once, wherever it is: an exception would leave a
half-loaded library. Later the first interrupt raises KeyboardInterrupt, so that the command saves
its result so far; the second one ends it at once, and so does CPU time beyond `GRACE`. What ends at
once is what a kill would leave: files are whole, and `--resume` continues. While a command only
writes its files (`writing`), the first one lets it end as usual, within `WRITTEN`.
"""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from types import FrameType
from typing import Any, NoReturn

INTERRUPTED = 130
REQUESTS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
GRACE = 1.2
"""CPU time [s] within which an interrupted command saves what it has."""
WRITTEN = 1.7
"""CPU time [s] within which an interrupted command writes the files of its complete result."""
FRAGILE = ("importlib._bootstrap", "numba.", "llvmlite.")
"""Modules through which no exception can be raised safely: imports and compilers."""
SHOW_CURSOR = b"\x1b[?25h"


class Interrupts:
    """The handler of these signals, and of exceptions that nothing can raise."""

    def __init__(self) -> None:
        self.requested = False
        self._kept: Callable[[], str] | None = None
        self._save: Callable[[], None] | None = None
        self._said = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        save, self._save = self._save, None
        if save is not None:
            self._quit_after(WRITTEN)
            with suppress(OSError):
                save()
            return
        if self.requested or self._kept is None or signal.getitimer(signal.ITIMER_VIRTUAL)[0] or _is_fragile(frame):
            self.quit()
        self.requested = True
        self._quit_after(GRACE)
        raise KeyboardInterrupt

    def _quit_after(self, seconds: float) -> None:
        signal.signal(signal.SIGVTALRM, lambda *_: self.quit())
        signal.setitimer(signal.ITIMER_VIRTUAL, seconds)

    @contextmanager
    def writing(self, save: Callable[[], None]) -> Iterator[None]:
        """Within this context the first signal is answered by `save`, for what follows may take too long."""
        self._save = save
        try:
            yield
        finally:
            self._save = None
            signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)

    def ignored(self, unraisable: Any) -> None:
        """`sys.unraisablehook`: an interrupt that a callback cannot raise ends the command."""
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            self.quit()
        if not self.requested:
            sys.__unraisablehook__(unraisable)

    def keeps(self, kept: Callable[[], str]) -> None:
        """From here on there is something to save; `kept` says what has been saved, and how to go on."""
        self._kept = kept

    def say(self, text: str = "") -> None:
        """Write the one line of an interrupted command."""
        if self._said:
            return
        self._said = True
        if not text:
            text = f"interrupted: {self._kept() if self._kept is not None else 'nothing was written'}"
        with suppress(OSError):
            os.write(2, (SHOW_CURSOR if os.isatty(2) else b"") + f"{text}\n".encode())

    def end(self) -> None:
        """The command has ended: nothing is left that a signal could interrupt."""
        for request in REQUESTS:
            if signal.getsignal(request) is self:
                signal.signal(request, signal.SIG_IGN)

    def quit(self) -> NoReturn:
        """End the process and those that it started, at once."""
        for request in (*REQUESTS, signal.SIGVTALRM):
            signal.signal(request, signal.SIG_IGN)
        with suppress(Exception):
            _end_processes()
        with suppress(Exception):
            self.say()
        os._exit(INTERRUPTED)


def listen() -> Interrupts:
    """Handle the signals from here on, except those that are ignored, as nohup leaves them."""
    if (known := current()) is not None:
        return known
    interrupts = Interrupts()
    for request in REQUESTS:
        if signal.getsignal(request) is not signal.SIG_IGN:
            signal.signal(request, interrupts)
    sys.unraisablehook = interrupts.ignored
    return interrupts


def current() -> Interrupts | None:
    """The handler of this process, None where it is not a command."""
    handlers = (signal.getsignal(request) for request in REQUESTS)
    return next((handler for handler in handlers if isinstance(handler, Interrupts)), None)


def keeps(kept: Callable[[], str]) -> None:
    """A command has begun to save, and can go on from there: see `Interrupts.keeps`."""
    if (interrupts := current()) is not None:
        interrupts.keeps(kept)


def writing(save: Callable[[], None]) -> AbstractContextManager[None]:
    """The result of a command is complete but for its files: see `Interrupts.writing`."""
    return nullcontext() if (interrupts := current()) is None else interrupts.writing(save)


def _is_fragile(frame: FrameType | None) -> bool:
    while frame is not None:
        if str(frame.f_globals.get("__name__", "")).startswith(FRAGILE):
            return True
        frame = frame.f_back
    return False


def _end_processes() -> None:
    """Kill the processes of pools, and unlink their semaphores, which would be reported as lost."""
    processes: Any = sys.modules.get("multiprocessing.process")
    locks: Any = sys.modules.get("multiprocessing.synchronize")
    for child in list(getattr(processes, "_children", ())):
        with suppress(Exception):
            child.kill()
    finalizers = getattr(sys.modules.get("multiprocessing.util"), "_finalizer_registry", {})
    unlink = locks.SemLock._cleanup if locks is not None else None
    for finalizer in list(finalizers.values()) if unlink is not None else ():
        with suppress(Exception):
            if finalizer._callback is unlink:
                finalizer()


# Standard streams that are closed or not read any more: a command goes on without them.


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
        sys.stdout = _replace_stream(1, sys.stdout, line_buffering=sys.stdout is not None and sys.stdout.isatty())
    if sys.stderr is sys.__stderr__:
        sys.stderr = _replace_stream(2, sys.stderr, line_buffering=True)


def warn_in_a_line(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
    """Print a warning of a model or a plugin without the place in the code; none of a library about
    its numbers, whose results are tested by those who use them.
    """
    library = category.__module__.partition(".")[0] in LIBRARIES
    if not library and not issubclass(category, RuntimeWarning):
        print(f"warning: {message}", file=sys.stderr, flush=True)


def _replace_stream(number: int, before: io.TextIOWrapper | Any, line_buffering: bool) -> io.TextIOWrapper:
    """A text stream over a file descriptor, with the encoding of the one that it replaces."""
    encoding, errors = getattr(before, "encoding", "utf-8"), getattr(before, "errors", "replace")
    raw = io.BufferedWriter(Unread(number, "w", closefd=False))
    return io.TextIOWrapper(raw, encoding, errors, line_buffering=line_buffering)
