"""Where the column names stand: below a preamble, above a row of units, above the measurements."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field

from ..errors import Fault
from .marks import is_date, is_missing, is_summary
from .notation import notation
from .signs import Exact
from .unit_text import is_unit_cell, split_header

Row = tuple[int, list[str]]
"""The number of a line, and its cells."""
SAMPLE = 400
"""Rows from the end that say which columns hold numbers."""


@dataclass(slots=True)
class Layout:
    """The rows of a table by kind: names, units, measurements; `faults` where that is ambiguous."""

    header: Row = (0, [])
    units: Row | None = None
    body: list[Row] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)


def laid_out(rows: list[Row], place: str) -> Layout:
    """The layout of rows that are not empty."""
    count = _usual(rows)
    numeric = _numeric(rows, count)
    first = _first_measurement(rows, count, numeric)
    names = [at for at in range(first) if _is_header(rows[at][1], count)]
    if not names:
        return _without_names(rows, count, place)
    at, units = _chosen(rows, names, first)
    layout = Layout(rows[at], rows[units] if units is not None else None)
    if faults := _rivals(rows, names, at, numeric, place):
        layout.faults = faults
    layout.body = rows[(at if units is None else units) + 1 :]
    if at:
        layout.notes.append(f"{at} lines above the column names are left out: {_listed(rows[:at])}")
    _without_summaries(layout, numeric)
    return layout


def _usual(rows: list[Row]) -> int:
    """The number of cells that most of the lower half of the rows have."""
    lower = rows[len(rows) // 2 :][-SAMPLE:]
    return Counter(len(_trimmed(row)) for _, row in lower).most_common(1)[0][0]


def _trimmed(row: list[str]) -> list[str]:
    return row[: max((at for at, cell in enumerate(row, 1) if cell), default=0)]


def _numeric(rows: list[Row], count: int) -> list[int]:
    """Columns that hold numbers or dates in most of the last rows."""
    lower = [row for _, row in rows[1:][-SAMPLE:] if len(row) >= count]
    lower = lower[len(lower) // 2 :]
    numeric = []
    for column in range(count):
        cells = [row[column] for row in lower if not is_missing(row[column])]
        good = sum(_is_measurement(cell) for cell in cells)
        if good and 2 * good >= len(cells):
            numeric.append(column)
    return numeric


def _is_measurement(cell: str) -> bool:
    return isinstance(cell, Exact) or notation(cell) is not None or is_date(cell)


def _first_measurement(rows: list[Row], count: int, numeric: list[int]) -> int:
    """The first full row with a number in a numeric column; without such columns the second one."""
    if not numeric:
        return next((at + 1 for at, (_, row) in enumerate(rows) if len(row) >= count), 0) or 1
    for at, (_, row) in enumerate(rows):
        if len(row) < count or not any(_is_measurement(row[column]) for column in numeric):
            continue
        if not _is_preamble(row, count) and not is_unit_row(row, numeric):
            return at
    return len(rows)


def _is_preamble(row: list[str], count: int) -> bool:
    """A row of a name and a value, padded with empty cells: "Datum;01.03.2026;;;"."""
    filled = [cell for cell in row if cell]
    return count > 3 and len(filled) <= 2 and bool(row[0]) and not _is_measurement(row[0])


def is_unit_row(row: list[str], numeric: list[int]) -> bool:
    """Whether a row holds units: every cell is a unit, or empty."""
    cells = [cell for cell in row if cell]
    stated = [cell for column, cell in enumerate(row) if cell and column in numeric]
    return (
        bool(stated)
        and all(is_unit_cell(cell) for cell in cells)
        and any(not re.fullmatch(r"[-\W]*|1", cell) for cell in stated)
    )


def _is_header(row: list[str], count: int) -> bool:
    """Whether a row can be that of the names: text in every cell but empty columns at the end."""
    names = _trimmed(row)
    return len(names) >= max(count, 1) and not any(_is_measurement(cell) for cell in names)


def _chosen(rows: list[Row], names: list[int], first: int) -> tuple[int, int | None]:
    """The row of names, and that of units below it: the last ones before the measurements."""
    last = names[-1]
    cells = rows[last][1]
    if len(names) > 1 and last == first - 1 and is_unit_row(cells, list(range(len(cells)))):
        return names[-2], last
    if last + 1 < first and is_unit_row(rows[last + 1][1], list(range(len(rows[last + 1][1])))):
        return last, last + 1
    return last, None


def _rivals(rows: list[Row], names: list[int], at: int, numeric: list[int], place: str) -> list[Fault]:
    """Rows right above the names that can be the names as well."""
    above = [row for row in names if row < at and rows[row][0] == rows[at][0] - (at - row)]
    if not above or at - 1 not in above:
        return []
    if any(split_header(name)[1] for name in rows[at][1]) and not any(split_header(n)[1] for n in rows[at - 1][1]):
        return []  # "Teil;Welle" above "Nr.;Abstand [mm]": names have units
    line, upper = rows[at][0], rows[at - 1][0]
    text = (
        f"lines {upper} and {line} can both be the column names; leave an empty line above the "
        "names, or remove the other line"
    )
    return [Fault(place, text)]


def _without_names(rows: list[Row], count: int, place: str) -> Layout:
    """The first full row as names, with what is wrong with them."""
    at = next((at for at, (_, row) in enumerate(rows) if len(row) >= count), 0)
    names = rows[at][1]
    layout = Layout(rows[at], None, rows[at + 1 :])
    above = [row for _, row in rows[:at] if len(row) > 1]
    if any(_is_measurement(cell) for cell in names) and above:
        text = (
            f"line {rows[at][0]} has {len(names)} cells, and no line above it as many names ({len(above[-1])} cells "
            "expected by the last one); where decimal commas stand between commas, export it with another delimiter"
        )
        layout.faults.append(Fault(place, text))
    elif any(_is_measurement(cell) for cell in names):
        layout.faults.append(
            Fault(
                place, f"has no column names: line {rows[at][0]} begins with measurements; add a line of names above it"
            )
        )
    return layout


def _without_summaries(layout: Layout, numeric: list[int]) -> None:
    """Leave out rows of limits below the names, and of means or an end mark below the data."""
    body = layout.body
    first = next((at for at, row in enumerate(body) if not _names_summary(row[1])), len(body))
    end = next((at for at in range(len(body), first, -1) if not _names_summary(body[at - 1][1])), first)
    dropped, layout.body = body[:first] + body[end:], body[first:end]
    if dropped:
        layout.notes.append(f"{len(dropped)} rows that hold no measurement are left out: {_listed(dropped)}")


def _names_summary(row: list[str]) -> bool:
    return is_summary(next((cell for cell in row if cell), ""))


def _listed(rows: list[Row]) -> str:
    """The first cells of some rows."""
    shown = [f'line {line} "{next((c for c in row if c), "")}"' for line, row in rows[:5]]
    return ", ".join(shown) + (", ..." if len(rows) > 5 else "")
