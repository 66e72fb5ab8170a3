"""From rows of cells to a table: names, units, decimal signs, and every fault of the form."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd

from ..errors import Fault
from .header import Layout, Row, laid_out
from .options import ReadOptions
from .record import Dialect, Table
from .signs import Evidence, canonical, decide, evidence
from .typed import is_label
from .unit_text import split_header, unit_of_cell

SHOWN = 100
"""Bad rows of a table, or bad cells of one column, that are named; the rest is counted."""


def assembled(
    rows: list[Row], dialect: Dialect, place: str, options: ReadOptions
) -> tuple[Table | None, list[Fault]]:
    """The table in the rows of a file, which are not empty."""
    layout = laid_out(rows, place)
    faults = list(layout.faults)
    header, body = _squared(layout)
    faults += _form_faults(header, body, place)
    whole = [row for row in body if len(row[1]) == len(header)] if faults else body
    columns = [list(cells) for cells in zip(*(row for _, row in whole), strict=True)]
    columns = columns or [[] for _ in header]
    given = {}
    for name, cells in zip(header, columns, strict=True):
        given.setdefault(name, cells)
    proofs = {name: evidence(cells) for name, cells in given.items()}
    if dialect.kind == "csv":
        signs, doubts = decide(proofs, options.decimal, dialect.delimiter, place)
    else:
        signs, doubts = decide(proofs, options.decimal, "", place)
    faults += doubts
    plain = {n: canonical(cells, signs[n] or ".") if _rewritten(proofs[n], signs.get(n)) else cells
             for n, cells in given.items()}  # fmt: skip
    return _table(layout, dialect, header, plain, proofs, signs, [at for at, _ in whole]), faults


def _rewritten(proof: Evidence, sign: str | None) -> bool:
    """Whether numbers of a column are not in plain notation."""
    return sign is not None and bool(sign == "," or proof.group or proof.comma)


def _table(
    layout: Layout,
    dialect: Dialect,
    header: list[str],
    columns: dict[str, list[str]],
    proofs: dict[str, Evidence],
    signs: dict[str, str],
    lines: list[int],
) -> Table:
    """The table with its names apart from their units."""
    names = _names(header)
    units = {names[n]: unit for n in columns if (unit := split_header(n)[1]) and names[n] != n}
    if layout.units is not None:
        for name, cell in zip(header, layout.units[1], strict=False):
            if cell and (unit := unit_of_cell(cell)):
                units.setdefault(names[name], unit)
    frame = pd.DataFrame(
        {names[name]: pd.Series(cells, index=lines, dtype=object) for name, cells in columns.items()}
    )
    numeric = tuple(
        names[n] for n in columns if proofs[n].numeric and not any(map(is_label, columns[n]))
    )
    used = [signs[n] for n in columns if signs.get(n) and (proofs[n].point or proofs[n].comma)]
    found = replace(
        dialect,
        decimal="".join(sorted(set(used)))[:1] if len(set(used)) == 1 else "",
        thousands=next((one.group for one in proofs.values() if one.group), ""),
        header=layout.header[0],
        unit_row=layout.units[0] if layout.units else 0,
    )
    notes = [*layout.notes, *_missing_notes(frame, numeric)]
    headers = {names[n]: n for n in columns}
    return Table(frame, found, units, tuple(notes), numeric, headers)


def _names(header: list[str]) -> dict[str, str]:
    """Column names without their units; whole where two would then be the same."""
    short = {name: split_header(name)[0] for name in header}
    taken = list(short.values()) + list(short)
    return {name: one if one == name or taken.count(one) == 1 else name
            for name, one in short.items()}  # fmt: skip


def _squared(layout: Layout) -> tuple[list[str], list[Row]]:
    """The names and the rows without cells at the end that are empty in every row."""
    header = [name.removeprefix("#").strip() if at == 0 else name
              for at, name in enumerate(layout.header[1])]  # fmt: skip
    body = layout.body
    while header and not header[-1] and all(
        len(row) < len(header) or not row[len(header) - 1] for _, row in body
    ):  # fmt: skip
        header = header[:-1]
    count = len(header)
    return header, [
        (at, row[:count] if len(row) > count and not any(row[count:]) else row) for at, row in body
    ]


def _form_faults(header: list[str], body: list[Row], place: str) -> list[Fault]:
    """Faults of column names and of rows of the wrong length."""
    found = []
    for name in dict.fromkeys(header):
        if not name:
            found.append(Fault(place, f"column {header.index(name) + 1} has no name"))
        elif header.count(name) > 1:
            found.append(Fault(place, f"column {name} appears {header.count(name)} times"))
    if not body:
        found.append(Fault(place, "has no rows below its column names"))
    wrong = [(at, len(row)) for at, row in body if len(row) != len(header)]
    text = f"{len(header)} cells expected, as many as there are column names, got"
    found += [Fault(f"{place}: row {at}", f"{text} {count}") for at, count in wrong[:SHOWN]]
    if len(wrong) > SHOWN:
        found.append(Fault(place, f"{len(wrong) - SHOWN} more rows of another length"))
    return found


def _missing_notes(frame: pd.DataFrame, numeric: tuple[str, ...]) -> list[str]:
    """How many cells of a column of numbers are none."""
    found = []
    for name in numeric:
        numbers = pd.to_numeric(frame[name], errors="coerce")
        bad = numbers.index[numbers.isna()]
        if len(bad):
            listed = ", ".join(f'row {at} "{frame[name][at]}"' for at in bad[:5])
            more = ", ..." if len(bad) > 5 else ""
            found.append(f"{name}: {len(bad)} cells hold no number: {listed}{more}")
    return found
