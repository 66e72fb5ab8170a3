"""Long files: the layout comes from their first and last lines, the readings all at once.

Whatever is not plain (quotes, empty lines, rows of many lengths, numbers with grouped thousands) is
read cell by cell instead, with the same result.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import csv

from .header import Row
from .notation import DECIMAL, Notation, notation
from .signs import PROBES, Evidence

LEAST = 300_000
"""Characters of a file that is long."""
ENDS = 400
"""Lines at each end that the layout comes from."""
_WIDE = "\u00a0\u2007\u202f\u3000"
"""Spaces beyond ASCII."""
_LABEL = r"^[+-]?0[0-9]+$"


@dataclass(frozen=True)
class Bulk:
    """The text of a long file whose lines are rows, each cell between delimiters."""

    text: str
    delimiter: str
    skipped: int
    breaks: int

    def columns(self, first: int, last: int, count: int) -> list[pa.Array] | None:
        """The cells of the lines `first` to `last`, by column; None where a row is not whole."""
        start = _before(self.text, first, self.breaks)
        end = _before(self.text, last + 1, self.breaks)
        body = self.text[start:end].encode()
        names = [str(at) for at in range(count)]
        try:
            table = csv.read_csv(
                pa.BufferReader(body),
                csv.ReadOptions(column_names=names, use_threads=False),
                csv.ParseOptions(delimiter=self.delimiter, quote_char=False, ignore_empty_lines=False),
                csv.ConvertOptions(column_types=dict.fromkeys(names, pa.string()),
                                   strings_can_be_null=False),  # fmt: skip
            )
        except pa.ArrowInvalid:
            return None
        if table.num_rows != last - first + 1:
            return None
        arrays = [column.combine_chunks() for column in table.columns]
        wide = any(one in self.text for one in _WIDE)
        trimmed = pc.utf8_trim_whitespace if wide else pc.ascii_trim_whitespace
        return [trimmed(one) for one in arrays]

    def ends(self) -> list[str]:
        """Lines of both ends, those of the middle left out."""
        head = self.text[: _before(self.text, ENDS + 1, self.breaks)].split("\n")[:-1]
        total = self.breaks + (not self.text.endswith("\n"))
        tail = self.text[_from_end(self.text, ENDS) :].removesuffix("\n").split("\n")
        return [*head, *([""] * (total - len(head) - len(tail))), *tail]


def bulk_of(text: str, delimiter: str, quote: str, skipped: int) -> Bulk | None:
    """A long file of plain rows; None of any other."""
    if len(text) < LEAST or quote in text or delimiter in ("", " ") or not delimiter.isascii():
        return None
    if "\r" in text and text.count("\r") != text.count("\r\n"):
        return None
    breaks = text.count("\n")
    return Bulk(text, delimiter, skipped, breaks) if breaks > 3 * ENDS else None


def rows_of_ends(bulk: Bulk) -> list[Row]:
    """The rows of both ends by the number of their line."""
    rows = [(at, [cell.strip() for cell in line.split(bulk.delimiter)])
            for at, line in enumerate(bulk.ends(), 1) if line.strip() and at > bulk.skipped]  # fmt: skip
    return [row for row in rows if any(row[1])]


def _before(text: str, line: int, total: int) -> int:
    """Where a line begins, or the end of the text, which has `total` line breaks."""
    if line - 1 > total:
        return len(text)
    if line - 1 > total // 2:
        at = len(text)
        for _ in range(total - (line - 1) + 1):
            at = text.rfind("\n", 0, at)
        return at + 1
    at = 0
    for _ in range(line - 1):
        at = text.find("\n", at) + 1
    return at


def _from_end(text: str, lines: int) -> int:
    """Where the last lines begin."""
    at = len(text) - text.endswith("\n")
    for _ in range(lines):
        at = text.rfind("\n", 0, at)
    return at + 1


def proven(cells: pa.Array) -> tuple[Evidence, NDArray[np.float64] | None] | None:
    """What the cells of a column prove, and its numbers; None where they must be looked at singly.

    All of them are numbers then, with one kind of sign that is decimal in one of them at least, or
    none of the probes is a number.
    """
    places = np.unique(np.linspace(0, len(cells) - 1, PROBES).astype(int)).tolist()
    probes = {at: notation(cells[at].as_py()) for at in places}
    if not any(probes.values()):
        return Evidence(values=len(cells)), None
    signs = [sign for sign in (".", ",") if pc.any(pc.match_substring(cells, sign)).as_py()]
    if len(signs) == 2 or pc.any(pc.match_substring_regex(cells, _LABEL)).as_py():
        return None
    found = Evidence(numbers=len(cells), values=len(cells))
    plain = cells
    if signs:
        sign = signs[0]
        at = _decisive(cells, probes)
        if at is None:
            return None
        (found.point if sign == "." else found.comma)[DECIMAL] = at
        plain = cells if sign == "." else pc.replace_substring(cells, ",", ".")
    try:
        values = plain.cast(pa.float64()).to_numpy()
    except pa.ArrowInvalid:
        return None
    return (found, values) if np.isfinite(values).all() else None


def _decisive(cells: pa.Array, probes: dict[int, Notation | None]) -> int | None:
    """The first cell whose sign can only be decimal; None where there is none."""
    for at, found in probes.items():
        if found is not None and DECIMAL in (found.point, found.comma):
            return at
    for at, cell in enumerate(cells.to_pylist()):
        found = notation(cell)
        if found is not None and DECIMAL in (found.point, found.comma):
            return at
    return None
