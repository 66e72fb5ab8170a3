"""Tables of the user's: read with every fault and its place, written whole or not at all.

The index of a table is the line number in its CSV file (the row number in a Parquet file, from 1).
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pandas as pd

from .errors import Fault, nearest, raise_all, refuse
from .files import write_text, write_with

SHOWN = 100
"""Bad cells of one column that are named; the rest is counted."""
PARQUET = (".parquet", ".pq")


def read(path: Path, place: str) -> pd.DataFrame:
    """A table from CSV or, by its suffix, Parquet. Raises InputError."""
    return _read_parquet(path, place) if path.suffix.lower() in PARQUET else read_csv(path, place)


def write(frame: pd.DataFrame, path: Path) -> None:
    """Write CSV or, by the suffix, Parquet; the index is left out."""
    if path.suffix.lower() in PARQUET:
        write_with(path, lambda part: frame.to_parquet(part, index=False))
    else:
        write_text(path, frame.to_csv(index=False, lineterminator="\n"))


def _content(path: Path, place: str) -> bytes:
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise refuse(place, "does not exist") from None
    except IsADirectoryError:
        raise refuse(place, "is a directory; name a file") from None
    except OSError as error:
        raise refuse(place, f"cannot be read: {error.strerror}") from error
    if not content.strip():
        raise refuse(
            place, "is empty; it needs a line of column names and one row or more below it"
        )
    return content


def _read_parquet(path: Path, place: str) -> pd.DataFrame:
    content = _content(path, place)
    try:
        frame = pd.read_parquet(io.BytesIO(content))
    except (OSError, ValueError) as error:
        raise refuse(place, f"is not a Parquet file ({error})") from error
    if frame.empty:
        raise refuse(place, "has no rows")
    return frame.set_axis(pd.RangeIndex(1, len(frame) + 1)).rename(columns=str)


def read_csv(path: Path, place: str) -> pd.DataFrame:
    """Every cell of a CSV file as stripped text. Raises InputError with all faults of its form."""
    try:
        text = _content(path, place).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = f"is not UTF-8 (byte {error.start}); save it as CSV in UTF-8"
        raise refuse(place, text) from error
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        numbered = ((reader.line_num, [cell.strip() for cell in row]) for row in reader)
        lines = {at: row for at, row in numbered if any(row)}
    except csv.Error as error:
        raise refuse(f"{place}: row {reader.line_num}", f"is not CSV ({error})") from error
    if not lines:
        raise refuse(
            place, "is empty; it needs a line of column names and one row or more below it"
        )
    header = lines.pop(min(lines))
    raise_all(_form_faults(header, lines, place))
    return pd.DataFrame(list(lines.values()), index=list(lines), columns=header, dtype=object)


def _form_faults(header: list[str], lines: dict[int, list[str]], place: str) -> list[Fault]:
    """Faults of column names and of rows of the wrong length."""
    found = []
    if len(header) == 1 and (";" in header[0] or "\t" in header[0]):
        found.append(Fault(place, "columns must be separated by commas"))
    for name in dict.fromkeys(header):
        if not name:
            found.append(Fault(place, f"column {header.index(name) + 1} has no name"))
        elif header.count(name) > 1:
            found.append(Fault(place, f"column {name} appears {header.count(name)} times"))
    if not lines:
        found.append(Fault(place, "has no rows below its column names"))
    wrong = [(at, len(row)) for at, row in lines.items() if len(row) != len(header)]
    text = f"{len(header)} cells expected, as many as there are column names, got"
    found += [Fault(f"{place}: row {at}", f"{text} {count}") for at, count in wrong[:SHOWN]]
    if len(wrong) > SHOWN:
        found.append(Fault(place, f"{len(wrong) - SHOWN} more rows of another length"))
    return found


def numbers(
    frame: pd.DataFrame,
    place: str,
    needed: Iterable[str],
    optional: Iterable[str] = (),
    text: Iterable[str] = (),
) -> pd.DataFrame:
    """The table with its columns as float64, those in `text` as they are.

    Raises InputError with every missing or unknown column and every cell that is no finite number.
    """
    typed, faults = parsed(frame, place, needed, optional, text)
    raise_all(faults)
    return typed


def parsed(
    frame: pd.DataFrame,
    place: str,
    needed: Iterable[str],
    optional: Iterable[str] = (),
    text: Iterable[str] = (),
) -> tuple[pd.DataFrame, list[Fault]]:
    """`numbers` that hands back the faults; bad cells are NaN, unknown columns are left out."""
    needed, text = list(needed), set(text)
    known = list(dict.fromkeys([*needed, *optional]))
    extra = [name for name in frame.columns if name not in known]
    missing = [name for name in needed if name not in frame.columns]
    found = [Fault(place, f"column {name} is missing") for name in missing]
    free = [name for name in known if name not in frame.columns]
    found += [Fault(place, f"column {name} is not known{nearest(name, free or known)}; remove it")
              for name in extra]  # fmt: skip
    typed = {}
    for name in (name for name in frame.columns if name in known):
        cells = frame[name].tolist()
        faults = {at: _label_fault(cell) for at, cell in zip(frame.index, cells, strict=True)}
        if name not in text:
            typed[name], faults = _numeric(frame.index, cells)
        else:
            typed[name] = cells
        found += cell_faults(place, name, {at: why for at, why in faults.items() if why})
    return pd.DataFrame(typed, index=frame.index), found


def cell_faults(place: str, column: str, bad: dict[Any, str]) -> list[Fault]:
    """A fault per bad cell of a column, by row; beyond `SHOWN` they are counted."""
    shown = list(bad.items())[:SHOWN]
    found = [Fault(f"{place}: row {at}, column {column}", why) for at, why in shown]
    if len(bad) > SHOWN:
        found.append(Fault(f"{place}: column {column}", f"{len(bad) - SHOWN} more bad cells"))
    return found


def _label_fault(cell: Any) -> str:
    empty = cell is None or cell == "" or (isinstance(cell, float) and math.isnan(cell))
    return "is empty" if empty else ""


def _numeric(rows: pd.Index[Any], cells: list[Any]) -> tuple[list[float], dict[Any, str]]:
    """The cells as numbers, NaN where a message says why not."""
    values, bad = [], {}
    for at, cell in zip(rows, cells, strict=True):
        value, why = _number(cell)
        values.append(value)
        if why:
            bad[at] = why
    return values, bad


def _number(cell: Any) -> tuple[float, str]:
    if cell is None or cell == "":
        return math.nan, "is empty; give a number"
    try:
        if isinstance(cell, bool) or (isinstance(cell, str) and "_" in cell):
            raise ValueError
        value = float(cell)
    except (TypeError, ValueError):
        return math.nan, f'must be a number, got "{cell}"'
    if not math.isfinite(value):
        return math.nan, f"must be a finite number, got {cell}"
    return value, ""
