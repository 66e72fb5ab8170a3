"""CSV and Parquet tables from the user, every fault found with its row and column."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .errors import Fault, InputError, nearest, raise_all, refuse


@dataclass(frozen=True, slots=True)
class Table:
    """Cells as text, the line of the file each row stands on, and a name for messages."""

    place: str
    header: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]

    def column(self, name: str) -> list[str]:
        """Cells of a column."""
        at = self.header.index(name)
        return [row[at] for row in self.cells]

    def where(self, row: int, column: str) -> str:
        """Place of a cell."""
        return f"{self.place}: row {self.lines[row]}, column {column}"


def read_text(path: Path, place: str) -> str:
    """The text of a file; raises InputError where it is missing, not UTF-8 or empty."""
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise refuse(place, f"no such file: {path}") from None
    except OSError as error:
        raise refuse(place, f"cannot be read ({error.strerror}): {path}") from error
    except UnicodeDecodeError as error:
        raise refuse(place, f"is not UTF-8 (byte {error.start}); save it as UTF-8") from error
    if not text.strip():
        raise refuse(place, "is empty")
    return text


def read_table(path: Path) -> Table:
    """A table with unique column names and rows of equal length.

    Raises InputError with every row that is ragged.
    """
    place = path.name
    if path.suffix == ".parquet":
        return _from_parquet(path, place)
    text = read_text(path, place)
    reader = csv.reader(io.StringIO(text))
    rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader if any(row)]
    (_, header), body = rows[0], rows[1:]
    faults = [Fault(f"{place}: header", f"column `{name}` stands there twice")
              for name in sorted({n for n in header if header.count(n) > 1})]  # fmt: skip
    faults += [Fault(f"{place}: row {line}", f"has {len(row)} cells, the header has {len(header)}")
               for line, row in body if len(row) != len(header)]  # fmt: skip
    if not body:
        faults.append(Fault(place, "has a header and no rows"))
    raise_all(faults)
    return Table(
        place, tuple(header), tuple(tuple(row) for _, row in body), tuple(line for line, _ in body)
    )


def _from_parquet(path: Path, place: str) -> Table:
    try:
        frame = pd.read_parquet(path)
    except FileNotFoundError:
        raise refuse(place, f"no such file: {path}") from None
    except (OSError, ValueError) as error:
        raise refuse(place, f"is not a Parquet file: {error}") from error
    if frame.empty:
        raise refuse(place, "has no rows")
    cells = tuple(tuple("" if pd.isna(c) else str(c) for c in row) for row in frame.to_numpy())
    return Table(place, tuple(map(str, frame.columns)), cells, tuple(range(1, len(cells) + 1)))


def column_faults(
    table: Table, needed: Collection[str], optional: Collection[str] = ()
) -> list[Fault]:
    """A fault for every needed column that is missing and every column that is not known."""
    known = [*needed, *optional]
    faults = [
        Fault(table.place, f"column `{name}` is missing")
        for name in needed
        if name not in table.header
    ]
    return faults + [
        Fault(f"{table.place}: header", f"unknown column `{name}`{nearest(name, known)}; remove it")
        for name in table.header
        if name not in known
    ]


def numbers(table: Table, names: Sequence[str]) -> tuple[NDArray[np.float64], list[Fault]]:
    """The named columns as finite numbers (rows, names), and a fault for every cell that is not."""
    found, faults = np.zeros((len(table.cells), len(names))), []
    for at, name in enumerate(names):
        for row, text in enumerate(table.column(name)):
            try:
                found[row, at] = value = float(text)
            except ValueError:
                value = np.nan if not text else None
            if value is None or not np.isfinite(value):
                wrong = f'must be a finite number, got "{text}"' if text else "is empty"
                faults.append(Fault(table.where(row, name), wrong))
    return found, faults


def refuse_all(faults: list[Fault], limit: int = 50) -> None:
    """Raise the faults; of more than `limit`, the rest is counted."""
    if len(faults) > limit:
        rest = Fault("...", f"and {len(faults) - limit} more faults of this table")
        raise InputError([*faults[:limit], rest])
    raise_all(faults)
