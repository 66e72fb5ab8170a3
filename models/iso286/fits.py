"""ISO 286 up to 500 mm: standard tolerance grades, fundamental deviations, and classes and fits by name
("25 g6", "25 H7/g6") from the shipped tables.
"""

from __future__ import annotations

import csv
import re
from collections import defaultdict
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

from ...errors import nearest
from ..inputs import Zone

MAX_SIZE_MM = 500.0
"""Largest nominal size of the tables [mm]."""


def rows_of(name: str) -> list[list[str]]:
    """The rows of a shipped table, its header first."""
    text = (files("tolevo.models.iso286") / name).read_text(encoding="utf-8")
    return list(csv.reader(text.splitlines()))


@lru_cache(maxsize=4)
def grade_table(name: str) -> tuple[tuple[float, ...], dict[str, tuple[float, ...]]]:
    """Upper ends of the size classes [mm], and the values [um] of each grade."""
    header, *rows = rows_of(name)
    ends = tuple(float(cell.removeprefix("<= ").removesuffix(" mm")) for cell in header[1:])
    return ends, {row[0]: tuple(map(float, row[1:])) for row in rows}


def value_um(name: str, grade: str, size: float) -> float:
    """The value [um] of a grade at a nominal size [mm] up to `MAX_SIZE_MM`."""
    ends, values = grade_table(name)
    return next(value for end, value in zip(ends, values[grade], strict=True) if size <= end)


def check_size(size: float) -> None:
    """Raises ValueError for a nominal size [mm] outside of the tables."""
    if not 0.0 < size <= MAX_SIZE_MM:
        raise ValueError(f"grades are tabulated for nominal sizes above 0 up to {MAX_SIZE_MM:g} mm, got {size:g} mm")


# Standard tolerance grades IT01 to IT18 for nominal sizes up to 500 mm.


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


# Fundamental deviations of shafts and holes for nominal sizes up to 500 mm.


SHAFTS = (*"abc", "cd", "d", "e", "ef", "f", "fg", *"gh", "js", *"jkmnprstuvxyz", "za", "zb", "zc")
HOLES = tuple(letter.upper() for letter in SHAFTS)
LETTERS = (*HOLES, *SHAFTS)
"""Letters of a fundamental deviation: capitals for holes."""
SYMMETRIC = "js"
SHAFTS_BELOW_NOMINAL = SHAFTS[: SHAFTS.index("h") + 1]
"""Letters of shafts below the nominal size, whose deviation is the upper one."""
REDUCED = ("k", "m", "n")
"""Letters K, M, N: their holes up to IT8 are moved by Delta, those of later letters up to IT7."""
MAX_SIZE_WITHOUT_DELTA = 3.0
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
    if shaft_letter in SHAFTS_BELOW_NOMINAL:
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
    if letter == "k" and not moved and size > MAX_SIZE_WITHOUT_DELTA:
        raise ValueError(f"ISO 286 has the letter K up to IT8 only above 3 mm, got {grade}")
    if letter == "n" and not moved and size > MAX_SIZE_WITHOUT_DELTA:
        return 0.0
    if letter == "m" and grade == "IT6" and 250.0 < size <= 315.0:
        return -9.0
    # the deviation k of the grades 4 to 7 is that of all holes K
    below = shaft_um(letter, "IT7" if letter == "k" else grade, size)
    if not moved or size <= MAX_SIZE_WITHOUT_DELTA:
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


# Tolerance classes and fits: "25 g6" as a zone, "25 H7/g6" as the classes of two parts.


_SIZE = r"^\s*(?:[Øø⌀]?\s*(\d+\.?\d*)\s*)?"
_CLASS = r"([A-Za-z]+)\s*(\d+)"
_FIT = re.compile(rf"{_SIZE}{_CLASS}\s*$")
_PAIR = re.compile(rf"{_SIZE}{_CLASS}\s*[/-]\s*{_CLASS}\s*$")


@dataclass(frozen=True, slots=True)
class Fit:
    """A tolerance class, with the nominal size [mm] where the text states one."""

    letter: str
    grade: str
    size: float | None = None

    @classmethod
    def of_text(cls, text: str) -> Fit:
        """What "25 H7", "H7" or "js6" states.

        Raises ValueError for another form, and for letters that ISO 286 does not have.
        """
        match = _FIT.match(text)
        if match is None:
            two = " (of two parts: [[fit]] with parts and size)" if _PAIR.match(text) else ""
            raise ValueError(f'write a fit as "25 H7" (size, letter, grade), got "{text}"{two}')
        size, letter, grade = match.groups()
        return cls(_letter(letter), f"IT{grade}", None if size is None else float(size))

    def __str__(self) -> str:
        return f"{self.letter}{self.grade.removeprefix('IT')}"


def pair_of_text(text: str) -> tuple[Fit, Fit]:
    """The classes of hole and shaft that "25 H7/g6" states.

    Raises ValueError for another form, and unless the first class is that of a hole and the second
    that of a shaft.
    """
    match = _PAIR.match(text)
    if match is None:
        raise ValueError(f'write a fit of two parts as "25 H7/g6" (size, hole, shaft), got "{text}"')
    size, hole, hole_grade, shaft, shaft_grade = match.groups()
    hole, shaft = _letter(hole), _letter(shaft)
    if hole not in HOLES or shaft not in SHAFTS:
        raise ValueError(f'must state the hole first, in capitals, and then the shaft, got "{text}"')
    number = None if size is None else float(size)
    return Fit(hole, f"IT{hole_grade}", number), Fit(shaft, f"IT{shaft_grade}", number)


def zone(fit: Fit, size: float) -> Zone:
    """The zone [mm] of a tolerance class at a nominal size [mm].

    Raises ValueError as `deviations_um` does.
    """
    lower, upper = deviations_um(fit.letter, fit.grade, size)
    return Zone((lower + upper) / 2000.0, (upper - lower) / 2000.0)


def _letter(text: str) -> str:
    if text in LETTERS:
        return text
    if text.lower() in SHAFTS:
        raise ValueError(f"the letter {text} mixes the cases: {text.upper()} is a hole, {text.lower()} a shaft")
    raise ValueError(
        f'"{text}" is not a letter of a fundamental deviation{nearest(text, LETTERS)}; '
        f"one of {', '.join(SHAFTS)}, in capitals for a hole"
    )
