"""The shipped tables of ISO 286: rows of a CSV file, and rows by size class."""

from __future__ import annotations

import csv
from functools import lru_cache
from importlib.resources import files

LARGEST = 500.0
"""Largest nominal size of the tables [mm]."""


def rows_of(name: str) -> list[list[str]]:
    """The rows of a shipped table, its header first."""
    text = (files("tolevo.models.iso286") / name).read_text(encoding="utf-8")
    return list(csv.reader(text.splitlines()))


@lru_cache(maxsize=4)
def by_grade(name: str) -> tuple[tuple[float, ...], dict[str, tuple[float, ...]]]:
    """Upper ends of the size classes [mm], and the values [um] of each grade."""
    header, *rows = rows_of(name)
    ends = tuple(float(cell.removeprefix("<= ").removesuffix(" mm")) for cell in header[1:])
    return ends, {row[0]: tuple(map(float, row[1:])) for row in rows}


def value_um(name: str, grade: str, size: float) -> float:
    """The value [um] of a grade at a nominal size [mm] up to `LARGEST`."""
    ends, values = by_grade(name)
    return next(value for end, value in zip(ends, values[grade], strict=True) if size <= end)


def check_size(size: float) -> None:
    """Raises ValueError for a nominal size [mm] outside of the tables."""
    if not 0.0 < size <= LARGEST:
        raise ValueError(f"grades are tabulated for nominal sizes above 0 up to {LARGEST:g} mm, got {size:g} mm")
