"""How one cell writes a number: which of its signs are decimal, which group thousands.

"0,412" can only be a decimal comma, "1.234.567" only thousands; "1,234" is either.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

_NUMBER = re.compile(
    r"[+\-−]?(?=[\d.,]*\d)(?P<mantissa>"
    r"(?:\d{1,3}(?:[ \u00a0\u202f\u2009'’]\d{3})+|[\d.,]*\d|\d+[.,])(?:[.,]\d+)?)"
    r"(?P<exponent>[eE][+\-−]?\d+)?"
)
LONGEST = 400
"""Characters of a number at most: a double written out has 330."""
_GROUPS = re.compile(r"[ \u00a0\u202f\u2009'’]")
_GROUPED = {sign: re.compile(rf"[1-9]\d{{0,2}}(?:{re.escape(sign)}\d{{3}})+") for sign in (".", ",")}
DECIMAL, THOUSANDS, EITHER = "decimal", "thousands", "either"


@dataclass(frozen=True, slots=True)
class Notation:
    """What the point and the comma of a number are; None where there is none."""

    point: str | None = None
    comma: str | None = None
    group: str = ""


PLAIN = Notation()
OTHER = {".": ",", ",": "."}


def notation(cell: str) -> Notation | None:
    """How a cell writes a number; None where it is none in any notation."""
    match = _NUMBER.fullmatch(cell) if len(cell) <= LONGEST else None
    if match is None:
        return None
    mantissa = match["mantissa"]
    spaced = _GROUPS.search(mantissa)
    points, commas = mantissa.count("."), mantissa.count(",")
    if not points and not commas:
        return Notation(group=spaced[0]) if spaced else PLAIN
    if spaced or match["exponent"]:
        return _sure(mantissa, points, commas, spaced[0] if spaced else "")
    if points and commas:
        return _notation_of_both_signs(mantissa)
    return _single_sign(mantissa, "." if points else ",", points + commas)


def _sure(mantissa: str, points: int, commas: int, group: str) -> Notation | None:
    """Notation with spaces between groups of digits, or with an exponent: a sign is decimal."""
    if points + commas != 1:
        return None
    return Notation(DECIMAL, None, group) if points else Notation(None, DECIMAL, group)


def _notation_of_both_signs(mantissa: str) -> Notation | None:
    """The sign that comes last is decimal, the other groups thousands."""
    last = max(".", ",", key=mantissa.rfind)
    whole, _, fraction = mantissa.rpartition(last)
    if not fraction.isdigit() or not _GROUPED[OTHER[last]].fullmatch(whole):
        return None
    return Notation(DECIMAL, THOUSANDS) if last == "." else Notation(THOUSANDS, DECIMAL)


def _single_sign(mantissa: str, sign: str, count: int) -> Notation | None:
    """One kind of sign: several group thousands; a single one before three digits is either."""
    if count > 1:
        what = THOUSANDS if _GROUPED[sign].fullmatch(mantissa) else None
    else:
        what = EITHER if _GROUPED[sign].fullmatch(mantissa) else DECIMAL
    if what is None:
        return None
    return Notation(what, None) if sign == "." else Notation(None, what)


def canonical_number(cell: str, decimal: str) -> str | None:
    """The number in plain notation where `decimal` is its decimal sign; None where it is none."""
    match = _NUMBER.fullmatch(cell) if len(cell) <= LONGEST else None
    signs = notation(cell) if match else None
    if match is None or signs is None:
        return None
    roles = {".": signs.point, ",": signs.comma}
    if roles[decimal] == THOUSANDS or roles[OTHER[decimal]] == DECIMAL:
        return None
    return _GROUPS.sub("", cell).replace(OTHER[decimal], "").replace(decimal, ".").replace("−", "-")
