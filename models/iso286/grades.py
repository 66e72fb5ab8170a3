"""Standard tolerance grades IT01 to IT18 for nominal sizes up to 500 mm."""

from __future__ import annotations

import csv
from functools import lru_cache
from importlib.resources import files

from ...errors import nearest

LARGEST = 500.0
"""Largest nominal size of the table [mm]."""
GRADES = ("IT01", *(f"IT{grade}" for grade in range(19)))
UNVERIFIED = frozenset({"IT01", "IT0", *(f"IT{grade}" for grade in range(13, 19))})
"""Grades whose values were not compared with a second source; IT1 to IT12 agree with two."""


@lru_cache(maxsize=1)
def _table() -> tuple[tuple[float, ...], dict[str, tuple[float, ...]]]:
    """Upper ends of the size classes [mm], and the tolerances of each grade [um]."""
    text = (files("tolevo.models.iso286") / "it_um.csv").read_text(encoding="utf-8")
    header, *rows = csv.reader(text.splitlines())
    ends = tuple(float(cell.removeprefix("<= ").removesuffix(" mm")) for cell in header[1:])
    return ends, {row[0]: tuple(map(float, row[1:])) for row in rows}


def grade_um(grade: str, size: float) -> float:
    """Width of the zone [um] of a grade ("IT7") at a nominal size [mm].

    Raises ValueError for an unknown grade and for a size outside of (0, 500] mm.

    Reference: ISO 286-1:2010, table 1 (values of the shipped table; see `UNVERIFIED`).
    """
    if grade not in GRADES:
        raise ValueError(
            f'"{grade}" is not a grade{nearest(grade, GRADES)}; one of {", ".join(GRADES)}'
        )
    if not 0.0 < size <= LARGEST:
        raise ValueError(
            f"grades are tabulated for nominal sizes above 0 up to {LARGEST:g} mm, got {size:g} mm"
        )
    ends, widths = _table()
    return next(w for end, w in zip(ends, widths[grade], strict=True) if size <= end)
