"""Text of CSV files in which no spreadsheet finds a formula, and the same files read again.

A spreadsheet computes a cell that begins with `=`, `+`, `-` or `@`, even a name from a table of
the user's. An apostrophe in front makes it text. Numbers stay as they are.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pandas as pd
from numpy.typing import NDArray

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:inf|nan)"
_NUMBERS = re.compile(rf"(?:{_NUMBER})(?:; (?:{_NUMBER}))*")
"""One number or several, as in the table of claims."""
_ACTIVE = re.compile(r"'*[=+\-@\t\r]")
"""How a formula begins, or a text that has apostrophes in front of such a beginning already."""
_MARKED = re.compile(r"'+[=+\-@\t\r]")
EXACT: Mapping[str, Any] = (
    {} if tuple(map(int, pd.__version__.split(".")[:2])) >= (3, 1) else {"float_precision": "round_trip"}
)
"""Options with which pandas reads every number as it was written; before 3.1 the last digit of some
was lost."""


def csv_text(frame: pd.DataFrame, header: bool = True) -> str:
    """A table without its index as CSV: LF line ends, and no cell or name that is a formula.

    Without its `header` it continues a file that has a header.
    """
    names = [neutral(name) for name in frame.columns]
    return _changed(frame, neutral).to_csv(index=False, lineterminator="\n", header=names if header else False)


def read_own_csv(path: Path | TextIO) -> pd.DataFrame:
    """A CSV table that `csv_text` wrote, every text and number as it was.

    Raises OSError where the file cannot be read, ValueError where it is not a table.
    """
    table = _changed(pd.read_csv(path, **EXACT), original)
    return table.set_axis([original(name) for name in table.columns], axis="columns")


def neutral(cell: Any) -> Any:
    """A cell that is text to a spreadsheet: with an apostrophe if it would be a formula."""
    if not isinstance(cell, str) or not _ACTIVE.match(cell) or _NUMBERS.fullmatch(cell):
        return cell
    return f"'{cell}"


def original(cell: Any) -> Any:
    """The argument of `neutral`, from its result."""
    return cell[1:] if isinstance(cell, str) and _MARKED.match(cell) else cell


def originals(cells: NDArray[Any]) -> NDArray[Any]:
    """`original` of every cell."""
    changed = _changed_cells(cells, original)
    return cells if changed is None else changed


def _changed(frame: pd.DataFrame, change: Callable[[Any], Any]) -> pd.DataFrame:
    """The table with the changed texts; the table itself where none changes."""
    columns = {at: _changed_cells(frame.iloc[:, at].to_numpy(), change) for at in range(frame.shape[1])}
    changed = {at: cells for at, cells in columns.items() if cells is not None}
    table = frame.copy() if changed else frame
    for at, cells in changed.items():
        table.isetitem(at, cells)
    return table


def _changed_cells(cells: NDArray[Any], change: Callable[[Any], Any]) -> NDArray[Any] | None:
    """The changed cells of a column; None where none changes."""
    if cells.dtype.kind not in "OUT":
        return None
    texts = {cell for cell in cells if isinstance(cell, str)}
    changed = {text: new for text in texts if (new := change(text)) != text}
    if not changed:
        return None
    column = np.empty(len(cells), dtype=object)
    column[:] = [changed.get(cell, cell) if isinstance(cell, str) else cell for cell in cells]
    return column
