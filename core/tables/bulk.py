"""Long files: the layout comes from their first and last lines, the cells are read all at once.

Whatever is not plain (quoted line breaks, empty lines, rows of many lengths) is read cell by cell
instead, with the same result.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import csv as arrow

from .header import Row
from .marks import MISSING
from .notation import DECIMAL, OTHER, THOUSANDS, Notation, notation
from .signs import PROBES, Evidence

LEAST = 300_000
"""Characters of a file that is long."""
ENDS = 400
"""Lines at each end that the layout comes from."""
_WIDE = "\u00a0\u2007\u202f\u3000"
"""Spaces beyond ASCII."""
_LABEL = r"^[+-]?0[0-9]+$|^[+-]?[0-9]{16,}$"
_GROUPED = {d: rf"^[+-]?(?:[0-9]+|[1-9][0-9]{{0,2}}(?:\{o}[0-9]{{3}})+)(?:\{d}[0-9]*)?$" for d, o in OTHER.items()}
_MARKS = pa.array(
    sorted(
        {form for mark in MISSING for form in (mark, mark.upper(), mark.title())}
        | {"n.i.O.", "NaN", "n.i.O", "k.A.", "k. A."}
    )
)
"""Marks as they are mostly written; another spelling is read cell by cell."""


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
        if _has_empty_rows(body, self.delimiter.encode() * (count - 1)):
            return None
        names = [str(at) for at in range(count)]
        try:
            table = arrow.read_csv(
                pa.BufferReader(body),
                arrow.ReadOptions(column_names=names, use_threads=False),
                arrow.ParseOptions(delimiter=self.delimiter, ignore_empty_lines=False),
                arrow.ConvertOptions(column_types=dict.fromkeys(names, pa.string()), strings_can_be_null=False),
            )
        except pa.ArrowInvalid:
            return None
        if table.num_rows != last - first + 1:
            return None
        arrays = [column.combine_chunks() for column in table.columns]
        wide = any(space in self.text for space in _WIDE)
        trimmed = pc.utf8_trim_whitespace if wide else pc.ascii_trim_whitespace
        return [trimmed(array) for array in arrays]

    def ends(self) -> list[str]:
        """Lines of both ends, those of the middle left out."""
        head = self.text[: _before(self.text, ENDS + 1, self.breaks)].split("\n")[:-1]
        total = self.breaks + (not self.text.endswith("\n"))
        tail = self.text[_from_end(self.text, ENDS) :].removesuffix("\n").split("\n")
        return [*head, *([""] * (total - len(head) - len(tail))), *tail]


def bulk_of(text: str, delimiter: str, quote: str, skipped: int) -> Bulk | None:
    """A long file of plain rows; None of any other."""
    if len(text) < LEAST or quote != '"' or delimiter in ("", " ") or not delimiter.isascii():
        return None
    if f'{delimiter} "' in text:  # a space before a quote: Arrow takes it for a part of the cell
        return None
    if "\r" in text and text.count("\r") != text.count("\r\n"):
        return None
    breaks = text.count("\n")
    return Bulk(text, delimiter, skipped, breaks) if breaks > 3 * ENDS else None


def rows_of_ends(bulk: Bulk) -> list[Row]:
    """The rows of both ends by the number of their line."""
    filled = [(at, line) for at, line in enumerate(bulk.ends(), 1) if line.strip()]
    lines = [line for line in filled if line[0] > bulk.skipped]
    reader = csv.reader((line for _, line in lines), delimiter=bulk.delimiter)
    rows = [(at, [*map(str.strip, row)]) for (at, _), row in zip(lines, reader, strict=False)]
    return [row for row in rows if any(row[1])]


def _has_empty_rows(body: bytes, hollow: bytes) -> bool:
    """Whether lines of bytes hold nothing, or nothing between their delimiters, `hollow`."""
    return any(ending in body for ending in (b"\n\n", b"\n\r\n", b"\n%b\n" % hollow, b"\n%b\r" % hollow))


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
    """What the cells of a column prove, and its numbers; None where they must be read one by one.

    The cells are then numbers or marks of missing values (NaN), with a sign that is decimal in at
    least one of them, or none of the probes is a number.
    """
    places = np.unique(np.linspace(0, len(cells) - 1, PROBES).astype(int)).tolist()
    probes = [notation(cells[at].as_py()) for at in places]
    if not any(probes):
        return Evidence(values=len(cells)), None
    unmarked = pc.if_else(pc.is_in(cells, _MARKS), pa.scalar(None, pa.string()), cells)
    if _any(pc.match_substring_regex(unmarked, _LABEL)):
        return None
    count = len(unmarked) - unmarked.null_count
    evidence = Evidence(numbers=count, values=count)
    plain = _without_signs(unmarked, [probe for probe in probes if probe is not None], evidence)
    if plain is None:
        return None
    try:
        values = plain.cast(pa.float64())
    except pa.ArrowInvalid:
        return None
    numbers = values.to_numpy(zero_copy_only=False)
    return (evidence, numbers) if np.isfinite(numbers).sum() == count else None


def _without_signs(cells: pa.Array, probes: list[Notation], evidence: Evidence) -> pa.Array | None:
    """The cells in plain notation, and what they prove; None where that is not plain to see."""
    signs = [sign for sign in (".", ",") if _any(pc.match_substring(cells, sign))]
    if not signs:
        return cells
    if len(signs) == 1:
        if (at := _decisive(cells, probes)) is None:
            return None
        (evidence.point if signs == ["."] else evidence.comma)[DECIMAL] = at
        return cells if signs == ["."] else pc.replace_substring(cells, ",", ".")
    votes = {("." if probe.point == DECIMAL else ",") for probe in probes if DECIMAL in (probe.point, probe.comma)}
    if len(votes) != 1:
        return None
    decimal = min(votes)
    grouping = OTHER[decimal]
    if not _all(pc.match_substring_regex(cells, _GROUPED[decimal])) or not _any(
        pc.match_substring_regex(cells, rf"\{grouping}[0-9]{{3}}\{decimal}")
    ):
        return None  # a sign that never groups for sure
    roles = (evidence.point, evidence.comma) if decimal == "." else (evidence.comma, evidence.point)
    roles[0][DECIMAL], roles[1][THOUSANDS] = 0, 0
    return pc.replace_substring(pc.replace_substring(cells, grouping, ""), decimal, ".")


def _any(matches: pa.Array) -> bool:
    return bool(pc.any(matches).as_py())


def _all(matches: pa.Array) -> bool:
    return bool(pc.all(matches).as_py())


def _decisive(cells: pa.Array, probes: list[Notation]) -> int | None:
    """A cell whose sign can only be decimal; None where there is none."""
    if any(DECIMAL in (probe.point, probe.comma) for probe in probes):
        return 0
    for at, cell in enumerate(cells.to_pylist()):
        written = notation(cell) if cell else None
        if written is not None and DECIMAL in (written.point, written.comma):
            return at
    return None
