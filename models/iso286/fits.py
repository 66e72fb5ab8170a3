"""Tolerance classes and fits: "25 g6" as a zone, "25 H7/g6" as the classes of two parts."""

from __future__ import annotations

import re
from dataclasses import dataclass

from ...errors import nearest
from ..inputs import Zone
from .deviations import HOLES, LETTERS, SHAFTS, deviations_um

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
