"""Arguments of the functions of the Python interface, and how they are passed on."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import pandas as pd

from . import tables
from .arguments import choice_faults, file_faults, source_faults, start_faults
from .configuration import Configuration
from .configuration.source import at_hand as once_read
from .errors import Fault, InputError, raise_all
from .files import unwritable
from .results import Scratch

if TYPE_CHECKING:
    from pymoo.core.problem import Problem

    from .problems.tolerance_problem import ToleranceProblem
    from .workflows.execution import Execution

AnyPath: TypeAlias = str | PathLike[str]
Raw: TypeAlias = "AnyPath | Mapping[str, Any] | ToleranceProblem | Problem"
"""A configuration: a path, a dictionary with the keys of the file, which may have objects in the
place of problem and algorithm, or a problem alone: of this suite, or of pymoo itself."""
Source: TypeAlias = "Raw | Configuration"
"""A configuration, or what `read` returns."""
Frame = AnyPath | pd.DataFrame
"""A table: a path, or a frame whose columns bear the names that the file would have."""
READ = "read"
NOTES = "notes"
"""Key in `attrs` of returned frames: how the table was read, and notes for the user."""
Tell = Callable[[str], None]
Result = TypeVar("Result")
Given = TypeVar("Given")


def collected(compute: Callable[[], Result], faults: Sequence[Fault]) -> Result:
    """The result of `compute`; its faults are raised together with the earlier `faults`."""
    try:
        return compute()
    except InputError as error:
        raise InputError([*error.faults, *faults]) from None


def executing(
    source: Source | Mapping[str, object],
    settings: Sequence[str],
    workers: int | None,
    dask: str,
    faults: list[Fault],
    block_rows: int | None = None,
    store: str | None = None,
) -> Execution:
    """Where a command computes: by its options and, where they state nothing, by its configuration;
    faults are added to `faults`.

    A command that can keep finished parts in a shared `store` passes its address, "" for none.
    """
    from .configuration.execution import read_execution
    from .workflows.execution import Execution

    options = Execution(workers, dask, block_rows, store=store or "")
    configuration = {} if isinstance(source, Configuration) else raw(source)
    execution, execution_faults = read_execution(configuration, settings, options, store is not None)
    faults += execution_faults
    return execution if store is not None else replace(execution, store="")


def start_faults_of(
    out: AnyPath | None, workers: int | None, resume: bool, overwrite: bool, shared: bool = False
) -> list[Fault]:
    """What keeps a command from starting with these arguments."""
    if out is not None:
        return start_faults(Path(out), workers, resume, overwrite, shared)
    faults = choice_faults(workers, resume, overwrite)
    if resume:
        faults.append(Fault("--resume", "needs the directory of the result that it continues: out"))
    return faults


def table_faults_of(
    out: AnyPath | None, source: Frame, partitioned: bool, resume: bool, overwrite: bool
) -> list[Fault]:
    """What keeps a table from being read, or its result, a file or a directory of blocks, from
    being written.
    """
    from .workflows.blocks import Target, folder_faults

    faults = choice_faults(None, resume, overwrite)
    read = None if isinstance(source, pd.DataFrame) else Path(source)
    if out is None:
        options = {"--resume": resume, "--overwrite": overwrite, "--partitioned": partitioned}
        text = "needs a file or directory to write to: out"
        return faults + [Fault(name, text) for name, is_set in options.items() if is_set]
    target = Target(Path(out), partitioned)
    if partitioned:
        faults += unwritable(target.path, "--out") + source_faults(target.path, read)
    else:
        faults += file_faults(target.path, read)
    if any(fault.place == "--out" for fault in faults):
        return faults
    return faults + (unwritable(target.blocks, "--out") or folder_faults(target.blocks, resume, overwrite))


def folder_for(out: AnyPath | None) -> tuple[Path, Scratch | None]:
    """The directory of the files: the user's, or a temporary directory, removed with the result."""
    if out is not None:
        return Path(fspath(out)), None
    scratch = Scratch()
    return scratch.path / "result", scratch


def at_hand(source: Given) -> Given | Path | Mapping[str, Any]:
    """The configuration, read at once where it comes through a pipe: that can be read but once."""
    return once_read(Path(source)) if isinstance(source, str | PathLike) else source


def raw(source: Raw) -> Path | Mapping[str, Any]:
    """A path or the tables of a configuration."""
    if isinstance(source, str | PathLike):
        return Path(source)
    return source if isinstance(source, Mapping) else {"problem": source}


def opened(source: Frame, options: tables.ReadOptions) -> tuple[tables.Table | None, list[Fault], str]:
    """A table, the faults of its form, and how they name it."""
    if isinstance(source, pd.DataFrame):
        return *tables.table_of(source, "frame"), "frame"
    path = Path(source)
    return *tables.opened(path, path.name, options), path.name


def readable(source: Frame, options: tables.ReadOptions) -> tuple[tables.Table, str]:
    """A table and how faults name it; raises those of its form."""
    table, faults, place = opened(source, options)
    raise_all(faults)
    assert table is not None
    return table, place


def report_lines(tell: Tell | None, kind: str, lines: Iterable[str]) -> None:
    """Call `tell` with each line, marked by its kind."""
    if tell is not None:
        for line in lines:
            tell(f"{kind}: {line}")
