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

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .errors import Fault, InputError, nearest, raise_all, refuse
from .files import clear_parts, write_bytes, write_text

SHOWN = 100
"""Bad cells of one column that are named; the rest is counted."""
PARQUET = (".parquet", ".pq")
EMPTY = "is empty; it needs a line of column names and one row or more below it"


def read(path: Path, place: str) -> pd.DataFrame:
    """A table from CSV or, by its suffix, Parquet. Raises InputError with faults of its form."""
    frame, faults = formed(path, place)
    raise_all(faults)
    assert frame is not None
    return frame


def formed(path: Path, place: str) -> tuple[pd.DataFrame | None, list[Fault]]:
    """`read` that hands back the faults, with what can be read all the same.

    Rows of another length are left out then, and of columns of one name all but the first; None
    where not even the column names are known.
    """
    try:
        content = _content(path, place)
        if path.suffix.lower() in PARQUET:
            return _from_parquet(content, place)
        return _from_csv(_text(content, place), place)
    except InputError as error:
        return None, list(error.faults)


def write(frame: pd.DataFrame, path: Path) -> None:
    """Write CSV or, by the suffix, Parquet; the index is left out."""
    clear_parts(path)
    if path.suffix.lower() in PARQUET:
        write_bytes(path, frame.to_parquet(index=False))
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
        raise refuse(place, EMPTY)
    return content


def _from_parquet(content: bytes, place: str) -> tuple[pd.DataFrame, list[Fault]]:
    try:
        frame = pd.read_parquet(io.BytesIO(content))
    except (OSError, ValueError) as error:
        raise refuse(place, f"is not a Parquet file ({error})") from error
    faults = [Fault(place, "has no rows")] if frame.empty else []
    return frame.set_axis(pd.RangeIndex(1, len(frame) + 1)).rename(columns=str), faults


def _text(content: bytes, place: str) -> str:
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = f"is not UTF-8 (byte {error.start}); save it as CSV in UTF-8"
        raise refuse(place, text) from error
    if "\0" in text:
        raise refuse(place, "is not text (it holds zero bytes); save it as CSV in UTF-8")
    return text


def _from_csv(text: str, place: str) -> tuple[pd.DataFrame | None, list[Fault]]:
    """Every cell as stripped text."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        numbered = ((reader.line_num, [cell.strip() for cell in row]) for row in reader)
        lines = {at: row for at, row in numbered if any(row)}
    except csv.Error as error:
        raise refuse(f"{place}: row {reader.line_num}", f"is not CSV ({error})") from error
    if not lines:
        raise refuse(place, EMPTY)
    header = lines.pop(min(lines))
    if len(header) == 1 and (";" in header[0] or "\t" in header[0]):
        raise refuse(place, "columns must be separated by commas")
    faults = _form_faults(header, lines, place)
    whole = {at: row for at, row in lines.items() if len(row) == len(header)} if faults else lines
    frame = pd.DataFrame(list(whole.values()), index=list(whole), columns=header, dtype=object)
    return frame.loc[:, ~frame.columns.duplicated()] if faults else frame, faults


def _form_faults(header: list[str], lines: dict[int, list[str]], place: str) -> list[Fault]:
    """Faults of column names and of rows of the wrong length."""
    found = []
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
        read = _labels if name in text else _numeric
        typed[name], bad = read(frame[name])
        found += cell_faults(place, name, bad)
    return pd.DataFrame(typed, index=frame.index), found


def cell_faults(place: str, column: str, bad: dict[Any, str]) -> list[Fault]:
    """A fault per bad cell of a column, by row; beyond `SHOWN` they are counted."""
    shown = list(bad.items())[:SHOWN]
    found = [Fault(f"{place}: row {at}, column {column}", why) for at, why in shown]
    if len(bad) > SHOWN:
        found.append(Fault(f"{place}: column {column}", f"{len(bad) - SHOWN} more bad cells"))
    return found


def _labels(column: pd.Series[Any]) -> tuple[NDArray[Any], dict[Any, str]]:
    """The cells as they are, and which of them are empty, by row."""
    cells = column.to_numpy()
    empty = np.flatnonzero(pd.isna(cells) | (cells == ""))
    return cells, dict.fromkeys(column.index[empty], "is empty")


def _numeric(column: pd.Series[Any]) -> tuple[NDArray[np.float64], dict[Any, str]]:
    """The cells as numbers, NaN where a message says why not, by row."""
    cells = column.to_numpy()
    values = _whole(cells)
    bad = {}
    doubted = np.arange(len(cells)) if values is None else np.flatnonzero(~np.isfinite(values))
    for at in doubted.tolist():
        why = _number(cells[at])[1]
        if why:
            bad[column.index[at]] = why
    if values is None:
        values = np.array([_number(cell)[0] for cell in cells], dtype=float)
    return np.where(np.isfinite(values), values, math.nan), bad


def _whole(cells: NDArray[Any]) -> NDArray[np.float64] | None:
    """A column of numbers at once; None where its cells must be looked at singly."""
    if cells.dtype.kind in "fiu":
        return cells.astype(float)
    if {type(cell) for cell in cells} != {str} or any("_" in cell for cell in cells):
        return None
    try:
        return cells.astype(float)
    except ValueError:
        return None


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
