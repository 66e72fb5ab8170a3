"""Fundamental deviations of shafts and holes for nominal sizes up to 500 mm."""

from __future__ import annotations

from collections import defaultdict
from functools import lru_cache

from .grades import GRADES, grade_um
from .tables import check_size, rows_of, value_um

SHAFTS = (*"abc", "cd", "d", "e", "ef", "f", "fg", *"gh", "js", *"jkmnprstuvxyz", "za", "zb", "zc")
HOLES = tuple(letter.upper() for letter in SHAFTS)
LETTERS = (*HOLES, *SHAFTS)
"""Letters of a fundamental deviation: capitals for holes."""
SYMMETRIC = "js"
ABOVE = SHAFTS[: SHAFTS.index("h") + 1]
"""Letters of shafts below the nominal size, whose deviation is the upper one."""
REDUCED = ("k", "m", "n")
"""Letters K, M, N: their holes up to IT8 are moved by Delta, those of later letters up to IT7."""
SMALLEST = 3.0
"""Up to this nominal size [mm] Delta is 0."""


def deviations_um(letter: str, grade: str, size: float) -> tuple[float, float]:
    """Lower and upper limit deviation [um] of a tolerance class at a nominal size [mm].

    JS and js are half the grade on either side, not rounded. Raises ValueError for a letter that
    does not exist, for one that the standard does not tabulate at this grade or size, and as
    `grade_um` does.

    Reference: ISO 286-1:2010, clause 4.3, tables 2 to 5.
    """
    width, shaft_letter = grade_um(grade, size), letter.lower()
    if letter not in LETTERS:
        raise ValueError(
            f'"{letter}" is not a letter of a fundamental deviation: one of {", ".join(SHAFTS)}, in capitals for a hole'
        )
    if shaft_letter == SYMMETRIC:
        return -0.5 * width, 0.5 * width
    hole = letter in HOLES
    if shaft_letter in ABOVE:
        upper = shaft_um(shaft_letter, grade, size)
        return (-upper, -upper + width) if hole else (upper - width, upper)
    if hole:
        upper = _hole_um(shaft_letter, grade, size)
        return upper - width, upper
    lower = shaft_um(shaft_letter, grade, size)
    return lower, lower + width


def shaft_um(letter: str, grade: str, size: float) -> float:
    """Fundamental deviation [um] of a shaft: the upper deviation of a to h, the lower from j on.

    Raises ValueError where the standard tabulates none.
    """
    check_size(size)
    if letter in ("a", "b") and size <= 1.0:
        raise ValueError(f"the letters a, b, A and B are not used up to 1 mm, got {size:g} mm")
    number = GRADES.index(grade) - 1  # IT01 and IT0 have the deviations of IT1
    for first, last, over, up_to, value in _shafts()[letter]:
        if first <= max(number, 1) <= last and over < size <= up_to:
            return value
    raise ValueError(f"ISO 286 has no fundamental deviation {letter} (or {letter.upper()}) for {grade} at {size:g} mm")


def _hole_um(letter: str, grade: str, size: float) -> float:
    """Upper deviation ES [um] of a hole from J on, from the shaft of the same letter.

    ES = -ei + Delta with Delta = IT(n) - IT(n - 1) above 3 mm, for K, M, N up to IT8 and for P to
    ZC up to IT7; -ei for coarser grades. Exceptions: J is tabulated, N9 and coarser ends at the
    nominal size above 3 mm, M6 from 250 to 315 mm ends at -9 um.
    """
    number = GRADES.index(grade) - 1
    if letter == "j":
        if grade not in ("IT6", "IT7", "IT8"):
            raise ValueError(f"ISO 286 has the letter J for IT6, IT7 and IT8 only, got {grade}")
        check_size(size)
        return value_um("hole_j_um.csv", grade, size)
    moved = number <= (8 if letter in REDUCED else 7)
    if letter == "k" and not moved and size > SMALLEST:
        raise ValueError(f"ISO 286 has the letter K up to IT8 only above 3 mm, got {grade}")
    if letter == "n" and not moved and size > SMALLEST:
        return 0.0
    if letter == "m" and grade == "IT6" and 250.0 < size <= 315.0:
        return -9.0
    # the deviation k of the grades 4 to 7 is that of all holes K
    below = shaft_um(letter, "IT7" if letter == "k" else grade, size)
    if not moved or size <= SMALLEST:
        return -below
    finer = grade_um(GRADES[max(number, 1)], size)  # IT(n - 1): GRADES begins with IT01
    return -below + grade_um(grade, size) - finer


@lru_cache(maxsize=1)
def _shafts() -> dict[str, list[tuple[float, float, float, float, float]]]:
    """First and last grade, sizes over and up to [mm], and deviation [um], by letter."""
    shafts = defaultdict(list)
    for letter, *values in rows_of("shaft_um.csv")[1:]:
        first, last, over, up_to, deviation = map(float, values)
        shafts[letter].append((first, last, over, up_to, deviation))
    return shafts
