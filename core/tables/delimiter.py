"""The delimiter of a text file, by clevercsv and by a rule of this package, which must agree."""

from __future__ import annotations

import csv
import re
from collections import Counter
from dataclasses import dataclass

from ..errors import refuse
from .marks import is_date, is_missing
from .notation import notation
from .options import NAMES

SAMPLE = 200
"""Lines that are looked at."""
DETECTED = 40
"""Lines that the detector looks at."""
CANDIDATES = (",", ";", "\t", "|")
SPACE = " "
STEADY, CLEAN = 0.8, 0.9
"""Least fraction of rows of one length, and of cells without any other delimiter."""
_SEP = re.compile(r'"?sep=(?P<sign>[^"\r\n])"?[;,\t]*\s*', re.IGNORECASE)
_UNIT = re.compile(r"\s*[\[(]?(?:mm|µm|um|arcmin|deg|Nm|N|rad|mrad|s|°C|%)[\])]?\s*")


@dataclass(frozen=True, slots=True)
class Separator:
    """The delimiter ("" of a single column), the quote, and lines before the table."""

    delimiter: str
    quote: str = '"'
    skipped: int = 0


def separator(lines: list[str], place: str, stated: str | None) -> Separator:
    """How the cells of the lines are separated. Raises InputError where it is ambiguous."""
    first = _SEP.fullmatch(lines[0]) if lines else None
    skipped = 1 if first else 0
    if stated is not None:
        return Separator(stated, '"', skipped)
    if first:
        return Separator(first["sign"], '"', 1)
    sample = [line for line in lines[: 2 * SAMPLE] if line.strip()][:SAMPLE]
    scores = {sign: _clean(sample, sign) for sign in CANDIDATES}
    fitting = [sign for sign, score in scores.items() if score >= CLEAN]
    if len(fitting) == 1:
        return _confirmed(sample, fitting[0], scores[fitting[0]], place)
    if fitting:
        raise _unknown(place, fitting)
    if _single(sample):
        return Separator("")
    if _clean(sample, SPACE) >= CLEAN:
        return Separator(SPACE)
    in_header = [sign for sign in CANDIDATES if sample and sign in sample[0]]
    if len(in_header) == 1:  # rows of many lengths: each is reported
        return Separator(in_header[0])
    raise _unknown(place, list(CANDIDATES))


def _confirmed(sample: list[str], sign: str, score: float, place: str) -> Separator:
    """The delimiter where the detector agrees, or where nothing speaks against it."""
    detected, quote = sign, '"'
    if score < 1.0 or any("'" in line for line in sample[:DETECTED]):
        detected, quote = _detected(sample)
    if detected != sign and score < 1.0:
        raise _unknown(place, [sign, detected])
    for candidate in CANDIDATES:
        if candidate != sign and _as_often(sample, candidate):
            raise _unknown(place, [sign, candidate])
    if sign == "," and _names_a_unit(sample):
        raise _unknown(place, [",", ""])
    return Separator(sign, quote)


def _detected(sample: list[str]) -> tuple[str, str]:
    """Delimiter and quote in the detector's opinion; it takes long, and so does its import."""
    from clevercsv import Detector

    try:
        dialect = Detector().detect("\n".join(sample[:DETECTED]), delimiters=[*CANDIDATES, SPACE])
    except (ValueError, RuntimeError, IndexError):
        dialect = None
    if dialect is None:
        return "", '"'
    return dialect.delimiter or "", "'" if dialect.quotechar == "'" else '"'


def _as_often(sample: list[str], sign: str) -> bool:
    """Whether a sign stands as often in the names as in every row, so that it can separate them."""
    if re.search(rf"\d{re.escape(sign)}\d", sample[0]):
        return False  # the first row is one of numbers
    counts = {line.count(sign) for line in sample}
    return len(sample) > 1 and len(counts) == 1 and min(counts) > 0


def _names_a_unit(sample: list[str]) -> bool:
    """Whether a comma stands between a name and its unit, and in decimals: "Laenge, mm"."""
    name, _, unit = sample[0].partition(",")
    rows = sample[1:]
    return bool(name and _UNIT.fullmatch(unit)) and all(re.fullmatch(r"-?\d+,\d+", row.strip()) for row in rows)


def _single(sample: list[str]) -> bool:
    """Whether lines are one column: each a value, none with a delimiter but a decimal comma."""
    if any(sign in sample[0] for sign in CANDIDATES):
        return False
    values = [line.strip().strip('"') for line in sample[1:]]
    if SPACE in sample[0].strip() and all(SPACE in value for value in values):
        return False
    return all(notation(value) or is_date(value) or not any(sign in value for sign in CANDIDATES) for value in values)


def _clean(sample: list[str], sign: str) -> float:
    """The fraction of cells without another delimiter in rows that are separated by `sign`; 0 where
    the rows are of many lengths or have no names above them.
    """
    if not any(sign in line for line in sample):
        return 0.0
    try:
        rows = list(csv.reader(sample, delimiter=sign, skipinitialspace=True))
    except csv.Error:
        return 0.0
    rows = [[cell.strip() for cell in row] for row in rows]
    if sign == SPACE:
        rows = [[cell for cell in row if cell] for row in rows]
    lower = rows[len(rows) // 2 :]
    count = Counter(map(len, lower)).most_common(1)[0][0]
    tops = [at for at, row in enumerate(rows) if len(row) == count and all(row)]
    if count < 2 or not tops:
        return 0.0
    # Without names every row holds measurements, which is reported when the table is laid out.
    header = next((at for at in tops if not any(notation(cell) for cell in rows[at])), -1)
    if sign == "," and header < 0 and sign not in sample[0] and not notation(sample[0].strip()):
        return 0.0  # one column of decimal commas below its name
    below = rows[header + 1 :]
    whole = [row for row in below if len(row) == count or not any(row[count:])]
    if not below or len(whole) < STEADY * len(below):
        return 0.0
    cells = [cell for row in whole for cell in row]
    return sum(_is_value(cell, sign) for cell in cells) / len(cells)


def _is_value(cell: str, sign: str) -> bool:
    """Whether a cell is a value, or text without any other delimiter."""
    if notation(cell) or is_date(cell) or is_missing(cell):
        return True
    return not any(candidate in cell for candidate in CANDIDATES if candidate != sign)


def _unknown(place: str, fitting: list[str]) -> Exception:
    names = " or ".join(dict.fromkeys(NAMES.get(sign, sign) for sign in fitting))
    remedy = "state --delimiter (comma, semicolon, tab, pipe, space)"
    return refuse(place, f"its columns can be separated by {names}, and the file does not show which: {remedy}")
