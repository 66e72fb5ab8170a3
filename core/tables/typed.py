"""Cells of numbers as numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

LONGEST = 15
"""Digits of a whole number that a double holds; longer ones are serial numbers."""


def typed(cells: pd.DataFrame, numeric: Sequence[str]) -> pd.DataFrame:
    """The table with the columns in `numeric` as numbers, None where a cell is none."""
    columns = {name: _column(cells[name].to_numpy(), name in numeric) for name in cells}
    return pd.DataFrame(columns, index=cells.index)


def _column(cells: NDArray[Any], numeric: bool) -> Any:
    if not numeric:
        if cells.dtype != object:
            return cells
        return pd.array([None if c is None or c == "" else c for c in cells], dtype=object)
    if cells.dtype.kind in "fiu":
        return cells
    if all(map(_is_whole, cells)):
        return cells.astype(np.int64)
    try:
        values = cells.astype(float)
    except ValueError:
        values = np.array([_value(cell) for cell in cells])
    bad = ~np.isfinite(values)
    if not bad.any():
        return values
    found = values.astype(object)
    found[bad] = None
    return found


def _is_whole(cell: Any) -> bool:
    return isinstance(cell, str) and cell.lstrip("+-").isdecimal() and cell.isascii()


def _value(cell: Any) -> float:
    """The number in a cell, NaN where it is none."""
    try:
        return math.nan if isinstance(cell, str) and "_" in cell else float(cell)
    except (TypeError, ValueError):
        return math.nan


def is_label(cell: str) -> bool:
    """Whether digits are a label: with a zero in front, or too many for a number."""
    digits = cell.lstrip("+-−")
    return digits.isdecimal() and len(digits) > 1 and (digits[0] == "0" or len(digits) > LONGEST)
