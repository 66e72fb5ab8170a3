"""Tolerance classes H, h, JS and js: "25 H7" as a zone."""

from __future__ import annotations

import re
from dataclasses import dataclass

from ..inputs import Zone
from .grades import grade_um

LETTERS = ("H", "h", "JS", "js")
"""The letters whose zones follow from the grade alone."""
_FIT = re.compile(r"^\s*(?:(\d+\.?\d*)\s*)?([A-Za-z]+)\s*(\d+)\s*$", re.ASCII)


@dataclass(frozen=True, slots=True)
class Fit:
    """A tolerance class, with the nominal size [mm] where the text states one."""

    letter: str
    grade: str
    size: float | None = None

    @classmethod
    def of_text(cls, text: str) -> Fit:
        """What "25 H7", "H7" or "js6" states.

        Raises ValueError for another form, and for letters whose deviations are not in the table.
        """
        match = _FIT.match(text)
        if match is None:
            raise ValueError(f'write a fit as "25 H7" (size, letter, grade), got "{text}"')
        size, letter, grade = match.groups()
        if letter not in LETTERS:
            raise ValueError(
                f"the letter {letter} is not available: its fundamental deviation is not in the "
                f'table; one of {", ".join(LETTERS)}, or give limits = "+0.02/-0.01"'
            )
        return cls(letter, f"IT{grade}", None if size is None else float(size))


def zone(fit: Fit, size: float) -> Zone:
    """The zone [mm] of a tolerance class at a nominal size [mm].

    H: from 0 up; h: from 0 down; JS and js: symmetric, half the grade on either side (not rounded).
    Raises ValueError as `grade_um` does.

    Reference: ISO 286-1:2010, clause 4.3.
    """
    width = grade_um(fit.grade, size) / 1000.0
    mid = {"H": 0.5, "h": -0.5}.get(fit.letter, 0.0) * width
    return Zone(mid, 0.5 * width)
