"""From a file or a dictionary, and the `--set` options of the command line, to raw tables."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

from ..errors import Fault, InputError
from .merging import merge
from .objects import with_names

Table = dict[str, Any]
Source = Path | Mapping[str, Any]
"""A TOML file, or a dictionary with the keys of such a file."""


EXECUTION = "execution"
"""The table of where a command computes, see `read_execution`."""


def folder_of(source: Source) -> Path:
    """The folder in which the files that a configuration names are looked for."""
    return source.parent if isinstance(source, Path) else Path()


def overridden(source: Source, overrides: Sequence[str], faults: list[Fault]) -> Table:
    """The tables of a configuration with `key=value` overrides; a bad one is added to `faults`.

    Raises InputError where a file cannot be read.
    """
    table = load(source, faults)
    if table is None:
        raise InputError(faults)
    override(table, overrides, faults)
    return table


def load(source: Source, faults: list[Fault]) -> Table | None:
    """The tables of a configuration, which may be changed, or None and the fault of its file.

    The table `[execution]`, of where to compute, is left out.
    """
    table = _loaded(source, faults)
    if table is not None:
        table.pop(EXECUTION, None)
    return table


def parsed_tables(source: Source, overrides: Sequence[str]) -> Table:
    """All tables of a configuration, with overrides; empty where it cannot be read."""
    table = _loaded(source, []) or {}
    _merged(table, overrides, [])
    return table


def _loaded(source: Source, faults: list[Fault]) -> Table | None:
    if not isinstance(source, Path):
        return deepcopy(with_names(source))
    place = str(source)
    try:
        text = source.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        message = "does not exist"
    except IsADirectoryError:
        message = "is a directory, not a configuration file"
    except UnicodeDecodeError as error:
        message = f"is not UTF-8 (byte {error.start}): save it as UTF-8"
    except (OSError, ValueError) as error:
        message = f"cannot be read ({getattr(error, 'strerror', None) or error})"
    else:
        if text.strip():
            return _parsed(text, place, faults)
        message = "is empty: a configuration must state at least a problem or a model"
    faults.append(Fault(place, message))
    return None


def _parsed(text: str, place: str, faults: list[Fault]) -> Table | None:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a number of thousands of digits is no TOML error
        faults.append(Fault(place, f"is not valid TOML: {error}"))
        return None


def override(table: Table, settings: Sequence[str], faults: list[Fault]) -> None:
    """Apply `key=value` settings to `table`; a value that is not TOML is taken as a string.

    Settings of `[execution]`, of where to compute, are left out.
    """
    _merged(table, settings, faults)
    table.pop(EXECUTION, None)


def _merged(table: Table, settings: Sequence[str], faults: list[Fault]) -> None:
    for setting in settings:
        key, sign, value = setting.partition("=")
        parsed = _setting(key.strip(), value.strip()) if sign else None
        if parsed is None:
            faults.append(Fault("--set", f'must be key=value, got "{setting}"'))
        elif not merge(table, parsed):
            faults.append(Fault(f"--set {key.strip()}", "leads through a value that is not a table"))


def _setting(key: str, value: str) -> Table | None:
    quoted = '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    for text in (value, quoted):
        try:
            return tomllib.loads(f"{key} = {text}") if "\n" not in key else None
        except (ValueError, RecursionError):
            continue
    return None
