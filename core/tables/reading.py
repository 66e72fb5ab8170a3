"""One entry to every table: text, workbook or Parquet, as they come."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import pandas as pd

from .. import files
from ..counts import is_forced
from ..errors import Fault, InputError, raise_all, refuse
from .aqdef.reading import SUFFIXES
from .assembling import assembled
from .columns import Columns
from .options import AS_DETECTED, ReadOptions
from .record import Dialect, Table
from .text import rows_of_text
from .unit_text import names_of, split_header

PARQUET = (".parquet", ".pq")
WORKBOOKS = (".xlsx", ".xlsm")
EMPTY = "is empty; it needs a line of column names and one row or more below it"
COLUMNS = 5000
"""Columns of a table at most."""
OLD = b"\xd0\xcf\x11\xe0"
"""How workbooks before XLSX begin."""


def read_table(
    path: str | Path, encoding: str | None = None, delimiter: str | None = None, decimal: str | None = None
) -> Table:
    """The table in a file: CSV in any dialect, XLSX or Parquet.

    What is not stated is detected. Raises InputError with every fault; for an ambiguous
    file it names the option that decides.
    """
    path = Path(path)
    return opened_whole(path, path.name, ReadOptions(encoding, delimiter, decimal))


def opened_whole(path: Path, place: str, options: ReadOptions = AS_DETECTED) -> Table:
    """The table in a file, which faults call `place`. Raises InputError with every fault."""
    table, faults = opened(path, place, options)
    raise_all(faults)
    assert table is not None
    return table


def opened(path: Path, place: str, options: ReadOptions = AS_DETECTED) -> tuple[Table | None, list[Fault]]:
    """`opened_whole` that returns the faults, with what can be read nevertheless.

    Rows of another length are then left out, and all but the first of columns with one name; None
    where not even the column names are known.
    """
    table, faults = _opened(path, place, options)
    return table, list(map(options.worded, faults))


def _opened(path: Path, place: str, options: ReadOptions) -> tuple[Table | None, list[Fault]]:
    if faults := options.faults():
        return None, faults
    try:
        suffix = path.suffix.lower()
        if suffix in SUFFIXES:
            from .aqdef.table import table_of_aqdef

            return table_of_aqdef(path, place, options)
        content = _content(path, place)
        if suffix in PARQUET or content[:4] == b"PAR1":
            return _from_parquet(content, place)
        if suffix in WORKBOOKS or content[:4] == b"PK\x03\x04":
            from .workbook import rows_of_workbook

            (rows, dialect), bulk = rows_of_workbook(content, place), None
        else:
            rows, dialect, bulk = rows_of_text(content, place, options)
        if not rows:
            raise refuse(place, EMPTY)
        if (most := max(len(cells) for _, cells in rows)) > COLUMNS and not is_forced():
            text = f"has {most} columns, {COLUMNS} are the most that are read: leave some out, or add --force"
            raise refuse(place, text)
        return assembled(rows, dialect, place, options, bulk)
    except InputError as error:
        return None, list(error.faults)


def _content(path: Path, place: str) -> bytes:
    try:
        content = files.content(path)
    except ValueError as error:
        raise refuse(place, str(error)) from None
    if not content.strip():
        raise refuse(place, EMPTY)
    if content.startswith(OLD):
        raise refuse(place, "is a workbook of the old format (.xls); save it as .xlsx or CSV")
    return content


def _from_parquet(content: bytes, place: str) -> tuple[Table, list[Fault]]:
    try:
        frame = pd.read_parquet(io.BytesIO(content))
    except (OSError, ValueError) as error:
        raise refuse(place, f"is not a Parquet file ({error})") from error
    table, faults = table_of(frame, place, "parquet")
    names = names_of(list(table.headers))
    units = {names[n]: split_header(n)[1] for n in names if names[n] != n}
    columns = Columns({names[str(n)]: frame[n].to_numpy() for n in frame}, range(1, len(frame) + 1))
    headers = {names[n]: n for n in table.headers}
    numeric = tuple(names[n] for n in table.numeric)
    return replace(table, columns=columns, units=units, numeric=numeric, headers=headers), faults


def table_of(frame: pd.DataFrame, place: str, kind: str = "frame") -> tuple[Table, list[Fault]]:
    """A frame as a table, its rows numbered from 1, and its faults."""
    faults = [Fault(place, "has no rows")] if frame.empty else []
    frame = frame.rename(columns=str)
    numeric = tuple(str(n) for n in frame if frame[n].dtype.kind in "fiu")
    headers = {str(name): str(name) for name in frame}
    columns = Columns({str(n): frame[n].to_numpy() for n in frame}, range(1, len(frame) + 1))
    return Table(columns, Dialect(kind, header=0), {}, (), numeric, headers), faults
