"""How a command ends: exit status, and errors as lines without a traceback."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

import typer

from .errors import TolevoError
from .files import cause
from .interrupts import INTERRUPTED, current
from .streams import warn_in_a_line


@contextmanager
def exit_status() -> Iterator[None]:
    """Errors as lines on stderr and an exit status, without a traceback for expected errors."""
    try:
        with warnings.catch_warnings():
            warnings.showwarning = warn_in_a_line
            yield
    except KeyboardInterrupt:
        _interrupted()
    except BaseException as error:
        if (interrupts := current()) is not None and interrupts.requested:
            _interrupted()  # an error of what was interrupted
        _failed(error)


def _interrupted() -> NoReturn:
    interrupts = current()
    if interrupts is None:
        typer.echo("interrupted: nothing more is written", err=True)
    else:
        interrupts.say()
    raise typer.Exit(INTERRUPTED) from None


def _failed(error: BaseException) -> NoReturn:
    """Raise Exit with the message of an expected error, and any other as it is."""
    if isinstance(error, TolevoError):
        typer.echo(str(error), err=True)
        raise typer.Exit(error.exit_status) from None
    if isinstance(error, OSError):
        typer.echo(f"failed: {_message(error)}", err=True)
        raise typer.Exit(1) from None
    raise error


def _message(error: OSError) -> str:
    """The message of an error of the system for the file that was to be written."""
    why = cause(error)
    if why is None or not error.filename:
        return str(error)
    return f"{error.filename} cannot be written: {why[0]}; what was there is kept; {why[1]}"
