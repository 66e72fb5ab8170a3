"""How a command ends: exit status, and errors as lines without a traceback."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import typer

from .errors import TolevoError
from .files import cause
from .streams import warn_in_a_line

INTERRUPTED = 130


@contextmanager
def exit_status() -> Iterator[None]:
    """Errors as lines on stderr and an exit status, without a traceback for expected errors."""
    try:
        with warnings.catch_warnings():
            warnings.showwarning = warn_in_a_line
            yield
    except TolevoError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(error.exit_status) from None
    except KeyboardInterrupt:
        typer.echo("interrupted: nothing more is written", err=True)
        raise typer.Exit(INTERRUPTED) from None
    except OSError as error:
        typer.echo(f"failed: {_message(error)}", err=True)
        raise typer.Exit(1) from None


def _message(error: OSError) -> str:
    """The message of an error of the system for the file that was to be written."""
    why = cause(error)
    if why is None or not error.filename:
        return str(error)
    return f"{error.filename} cannot be written: {why[0]}; what was there is kept; {why[1]}"
