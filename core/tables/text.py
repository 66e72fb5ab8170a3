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


def rows_of_text(content: bytes, place: str, options: ReadOptions) -> tuple[list[Row], Dialect, Bulk | None]:
    """The rows of a file that are not empty, by the number of their line, and its dialect.

    For a long file, the rows at both ends and the bulk of it.
    """
    text, encoding = decoded(content, place, options.encoding)
    form = separator(text[:100_000].splitlines(), place, options.separator)
    dialect = Dialect("csv", encoding, form.delimiter, quote=form.quote)
    bulk = bulk_of(text, form.delimiter, form.quote, form.skipped)
    if bulk is not None:
        return rows_of_ends(bulk), dialect, bulk
    return rows_of(text, form, place), dialect, None


def rows_of(text: str, form: Separator, place: str) -> list[Row]:
    """The rows of a text that are not empty."""
    stream = io.StringIO(text, newline="")
    for _ in range(form.skipped):
        stream.readline()
    if form.delimiter in ("", " "):
        return _by_spaces(stream, form.skipped, form.delimiter)
    reader = csv.reader(stream, delimiter=form.delimiter, quotechar=form.quote, skipinitialspace=True, strict=True)
    skipped = form.skipped
    try:
        rows = [(reader.line_num + skipped, [*map(str.strip, row)]) for row in reader]
    except csv.Error as error:
        raise refuse(f"{place}: row {reader.line_num + skipped}", f"is not CSV ({error})") from error
    return [row for row in rows if any(row[1])]


def _by_spaces(stream: io.StringIO, skipped: int, delimiter: str) -> list[Row]:
    """Rows whose cells are separated by runs of spaces, or that are one cell each."""
    rows = []
    for at, line in enumerate(stream, skipped + 1):
        stripped = line.strip()
        if stripped:
            cells = _SPACES.split(stripped) if delimiter else [stripped]
            rows.append((at, [cell.strip('"') for cell in cells]))
    return rows
