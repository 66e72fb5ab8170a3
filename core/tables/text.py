"""Rows of a text file."""

from __future__ import annotations

import csv
import io
import re

from ..errors import refuse
from .bulk import Bulk, bulk_of, rows_of_ends
from .delimiter import Separator, separator
from .encoding import decoded
from .header import Row
from .options import ReadOptions
from .record import Dialect

_SPACES = re.compile(r"[ \t]+")


def rows_of_text(
    content: bytes, place: str, options: ReadOptions
) -> tuple[list[Row], Dialect, Bulk | None]:
    """The rows of a file that are not empty, by the number of their line, and its dialect.

    Of a long file, the rows at both ends and the bulk of it.
    """
    text, encoding = decoded(content, place, options.encoding)
    head = text[:100_000].splitlines()
    found = separator(head, place, options.separator)
    dialect = Dialect("csv", encoding, found.delimiter, quote=found.quote)
    bulk = bulk_of(text, found.delimiter, found.quote, found.skipped)
    if bulk is not None:
        return rows_of_ends(bulk), dialect, bulk
    return rows_of(text, found, place), dialect, None


def rows_of(text: str, found: Separator, place: str) -> list[Row]:
    """The rows of a text that are not empty."""
    stream = io.StringIO(text, newline="")
    for _ in range(found.skipped):
        stream.readline()
    if found.delimiter in ("", " "):
        return _by_spaces(stream, found.skipped, found.delimiter)
    reader = csv.reader(
        stream, delimiter=found.delimiter, quotechar=found.quote, skipinitialspace=True, strict=True
    )
    skipped = found.skipped
    try:
        rows = [(reader.line_num + skipped, [*map(str.strip, row)]) for row in reader]
    except csv.Error as error:
        raise refuse(
            f"{place}: row {reader.line_num + skipped}", f"is not CSV ({error})"
        ) from error
    return [row for row in rows if any(row[1])]


def _by_spaces(stream: io.StringIO, skipped: int, delimiter: str) -> list[Row]:
    """Rows whose cells are separated by runs of spaces, or that are one cell each."""
    found = []
    for at, line in enumerate(stream, skipped + 1):
        bare = line.strip()
        if bare:
            cells = _SPACES.split(bare) if delimiter else [bare]
            found.append((at, [cell.strip('"') for cell in cells]))
    return found
