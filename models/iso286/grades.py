"""Standard tolerance grades IT01 to IT18 for nominal sizes up to 500 mm."""

from __future__ import annotations

from ...errors import nearest
from .tables import check_size, value_um

GRADES = ("IT01", *(f"IT{grade}" for grade in range(19)))
UNVERIFIED = frozenset({"IT01", "IT0", *(f"IT{grade}" for grade in range(13, 19))})
"""Grades whose values were not compared with a second source; IT1 to IT12 agree with two."""


def grade_um(grade: str, size: float) -> float:
    """Width of the zone [um] of a grade ("IT7") at a nominal size [mm].

    Raises ValueError for an unknown grade and for a size outside of (0, 500] mm.

    Reference: ISO 286-1:2010, table 1 (values of the shipped table; see `UNVERIFIED`).
    """
    if grade not in GRADES:
        raise ValueError(f'"{grade}" is not a grade{nearest(grade, GRADES)}; one of {", ".join(GRADES)}')
    check_size(size)
    return value_um("it_um.csv", grade, size)
