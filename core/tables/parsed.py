"""Columns of a table in their required types, with every fault and its place."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..csv_text import csv_text
from ..errors import Fault, nearest
from ..files import clear_parts, write_bytes, write_text
from ..units import shortened
from .assembling import SHOWN
from .reading import PARQUET

HEADER = 2**20
"""Bytes of a line of column names at most."""


def write(frame: pd.DataFrame, path: Path) -> None:
    """Write CSV or, by the suffix, Parquet; the index is left out."""
    clear_parts(path)
    if path.suffix.lower() in PARQUET:
        write_bytes(path, frame.to_parquet(index=False))
    else:
        write_text(path, csv_text(frame))


def columns_of(path: Path) -> list[str]:
    """The columns of a table that `write` wrote; none where a file is no such table."""
    from pyarrow import ArrowInvalid
    from pyarrow.parquet import read_schema

    with path.open("rb") as file:
        first = file.readline(HEADER)
    try:
        if first.startswith(b"PAR1"):
            return [str(name) for name in read_schema(path).names]
        return next(csv.reader([first.decode(errors="replace").rstrip("\n")]), [])
    except (ArrowInvalid, OSError, csv.Error):
        return []


def parsed(
    frame: pd.DataFrame, place: str, needed: Iterable[str], optional: Iterable[str] = (), text: Iterable[str] = ()
) -> tuple[pd.DataFrame, list[Fault]]:
    """The table with its columns as float64, those in `text` as they are, and a fault for every
    missing or unknown column and every cell that is not a finite number; bad cells are NaN, unknown
    columns are left out.
    """
    needed, text = list(needed), set(text)
    known = list(dict.fromkeys([*needed, *optional]))
    extra = [name for name in frame.columns if name not in known]
    missing = [name for name in needed if name not in frame.columns]
    faults = [Fault(place, f"column {name} is missing") for name in missing]
    free = [name for name in known if name not in frame.columns]
    faults += [Fault(place, f"column {name} is not known{nearest(name, free or known)}; remove it") for name in extra]
    typed = {}
    for name in (name for name in frame.columns if name in known):
        read = _labels if name in text else _numeric
        typed[name], bad = read(frame[name])
        faults += cell_faults(place, name, bad)
    return pd.DataFrame(typed, index=frame.index), faults


def cell_faults(place: str, column: str, bad: dict[Any, str]) -> list[Fault]:
    """A fault per bad cell of a column, by row; beyond `SHOWN` they are counted."""
    shown = list(bad.items())[:SHOWN]
    faults = [Fault(f"{place}: row {at}, column {column}", why) for at, why in shown]
    if len(bad) > SHOWN:
        faults.append(Fault(f"{place}: column {column}", f"{len(bad) - SHOWN} more bad cells"))
    return faults


def _labels(column: pd.Series[Any]) -> tuple[NDArray[Any], dict[Any, str]]:
    """The cells as they are, and which of them are empty, by row."""
    cells = column.to_numpy()
    blank = np.flatnonzero(pd.isna(cells) | (cells == ""))
    return cells, dict.fromkeys(column.index[blank], "is empty")


def _numeric(column: pd.Series[Any]) -> tuple[NDArray[np.float64], dict[Any, str]]:
    """The cells as numbers, NaN where a message says why not, by row."""
    cells = column.to_numpy()
    values = _numeric_column(cells)
    doubted = np.arange(len(cells)) if values is None else np.flatnonzero(~np.isfinite(values))
    bad = {column.index[at]: why for at in doubted.tolist() if (why := _number(cells[at])[1])}
    if values is None:
        values = np.array([_number(cell)[0] for cell in cells], dtype=float)
    return np.where(np.isfinite(values), values, math.nan), bad


def _numeric_column(cells: NDArray[Any]) -> NDArray[np.float64] | None:
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
        return math.nan, f'must be a number, got "{shortened(str(cell))}"'
    if not math.isfinite(value):
        return math.nan, f"must be a finite number, got {cell}"
    return value, ""
