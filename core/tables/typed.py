"""Cells of numbers as numbers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

LONGEST = 15
"""Digits of a whole number that a double holds; longer ones are serial numbers."""


def whole_if_so(values: NDArray[np.float64], whole_numbers: bool = True) -> NDArray[Any]:
    """Numbers, as integers where all are whole and may be; None where one is missing."""
    bad = np.isnan(values)
    if bad.any():
        column = values.astype(object)
        column[bad] = None
        return column
    if not whole_numbers:
        return values
    whole: NDArray[np.int64] = values.astype(np.int64)
    return whole if (whole == values).all() else values


def typed_column(cells: NDArray[Any], numeric: bool) -> NDArray[Any]:
    """The cells of a column as numbers or as text, None where one is missing or invalid."""
    if not numeric:
        if cells.dtype != object:
            return cells
        column = cells.copy()
        column[np.asarray((cells == "") | pd.isna(cells), dtype=bool)] = None
        return column
    if cells.dtype.kind in "fiu":
        return cells
    if all(map(_is_whole, cells)):
        return cells.astype(np.int64)
    try:
        if any("_" in cell for cell in cells if isinstance(cell, str)):  # Python reads 1_000 as a number
            raise ValueError
        numbers = cells.astype(float)
    except ValueError:
        numbers = np.array([_value(cell) for cell in cells])
    return whole_if_so(np.where(np.isfinite(numbers), numbers, math.nan), False)


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
