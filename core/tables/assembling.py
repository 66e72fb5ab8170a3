"""From rows of cells to a table: names, units, decimal signs, and every fault of the form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..csv_text import original
from ..errors import Fault
from ..units import converted, fits
from .bulk import Bulk, proven
from .columns import Columns
from .delimiter import Separator
from .header import Layout, Row, laid_out
from .options import ReadOptions
from .record import Dialect, Table
from .signs import Evidence, canonical, decide, evidence
from .text import rows_of
from .typed import is_label
from .unit_text import names_of, split_header, unit_of_cell

SHOWN = 100
"""Bad rows of a table, or bad cells of one column, that are listed; the rest is counted."""


def assembled(
    rows: list[Row], dialect: Dialect, place: str, options: ReadOptions, bulk: Bulk | None = None
) -> tuple[Table | None, list[Fault]]:
    """The table in the rows of a file, which are not empty; for a long file, in its bulk."""
    layout = laid_out(rows, place)
    header, body = _squared(layout)
    faults = [*layout.faults, *_form_faults(header, body, place)]
    whole = [row for row in body if len(row[1]) == len(header)] if faults else body
    lines = [at for at, _ in whole]
    columns: list[Any] = [list(cells) for cells in zip(*(row for _, row in whole), strict=True)]
    if bulk is not None:
        arrays = None if faults else bulk.columns(lines[0], lines[-1], len(header))
        if arrays is None:
            separator = Separator(dialect.delimiter, dialect.quote, bulk.skipped)
            return assembled(rows_of(bulk.text, separator, place), dialect, place, options)
        columns, lines = arrays, list(range(lines[0], lines[-1] + 1))
    columns = columns or [[] for _ in header]
    cells_of: dict[str, Any] = {}
    for name, cells in zip(header, columns, strict=True):
        cells_of.setdefault(name, cells)
    proofs, numbers = _proofs(cells_of)
    delimiter = dialect.delimiter if dialect.kind == "csv" else ""
    signs, doubts = decide(proofs, options.decimal, delimiter, place, partial(_near, options, _units(layout, header)))
    plain = {n: _canonical_cells(cells, proofs[n], signs.get(n)) for n, cells in cells_of.items()}
    return _table(layout, dialect, header, plain, proofs, signs, lines, numbers), faults + doubts


def _proofs(cells_of: dict[str, Any]) -> tuple[dict[str, Evidence], dict[str, NDArray[Any]]]:
    """What the cells of each column prove, and the numbers of those that are read at once."""
    proofs, numbers = {}, {}
    for name, cells in cells_of.items():
        if isinstance(cells, list):
            proofs[name] = evidence(cells)
            continue
        quick = proven(cells)
        if quick is None:
            cells_of[name] = cells.to_pylist()
            proofs[name] = evidence(cells_of[name])
        else:
            proofs[name] = quick[0]
            if quick[1] is not None:
                numbers[name] = quick[1]
    return proofs, numbers


def _canonical_cells(cells: Any, proof: Evidence, sign: str | None) -> Any:
    """The cells of a column with numbers in plain notation."""
    if sign is None or not isinstance(cells, list):
        return cells
    plain = not (sign == "," or proof.group or proof.comma or any("−" in cell for cell in cells))
    return cells if plain else canonical(cells, sign or ".")


def _table(
    layout: Layout,
    dialect: Dialect,
    header: list[str],
    columns: dict[str, Any],
    proofs: dict[str, Evidence],
    signs: dict[str, str],
    lines: list[int],
    quick: dict[str, NDArray[Any]],
) -> Table:
    """The table with its names apart from their units."""
    names, units = names_of(header), _units(layout, header)
    numeric = tuple(
        names[n] for n in columns if n in quick or (proofs[n].numeric and not any(map(is_label, columns[n])))
    )
    used = [signs[n] for n in columns if signs.get(n) and (proofs[n].point or proofs[n].comma)]
    complete = replace(
        dialect,
        decimal="".join(sorted(set(used)))[:1] if len(set(used)) == 1 else "",
        thousands=next((proof.group for proof in proofs.values() if proof.group), ""),
        header=layout.header[0],
        unit_row=layout.units[0] if layout.units else 0,
    )
    slow = [name for name in numeric if name not in {names[n] for n in quick}]
    slow += [names[n] for n, values in quick.items() if np.isnan(values).any()]
    values = {names[n]: column for n, column in quick.items()}
    cells_of = {names[n]: column for n, column in columns.items()}
    notes = [*layout.notes]
    for name in slow:
        notes += _missing_notes(name, cells_of[name], lines, values.get(name))
    headers = {names[n]: n for n in columns}
    return Table(Columns(cells_of, lines), complete, units, tuple(notes), numeric, headers, values)


def _units(layout: Layout, header: list[str]) -> dict[str, str]:
    """The units that names or a row of units state, by the name without them."""
    names = names_of(header)
    units = {names[n]: unit for n in header if (unit := split_header(n)[1]) and names[n] != n}
    if layout.units is not None:
        for name, cell in zip(header, layout.units[1], strict=False):
            if cell and (unit := unit_of_cell(cell)):
                units.setdefault(names[name], unit)
    return units


def _near(options: ReadOptions, units: Mapping[str, str], column: str, value: float) -> bool:
    """Whether a value is between half and twice the nominal size of its column, where that is known."""
    name = split_header(column)[0]
    sizes = options.sizes
    size = next((sizes[key] for key in (column, name, "") if key in sizes), None)
    if size is None:
        return False
    nominal, unit, stated = *size, units.get(name) or units.get(column)
    if stated and unit and fits(stated, unit):
        value = float(converted(value, stated, unit))
    return 0.5 <= value / nominal <= 2.0 if nominal else False


def _squared(layout: Layout) -> tuple[list[str], list[Row]]:
    """The names and the rows without cells at the end that are empty in every row."""
    header = [original(name.removeprefix("#").strip() if at == 0 else name) for at, name in enumerate(layout.header[1])]
    body = layout.body
    while header and not header[-1] and all(len(row) < len(header) or not row[len(header) - 1] for _, row in body):
        header = header[:-1]
    count = len(header)
    return header, [(at, row[:count] if len(row) > count and not any(row[count:]) else row) for at, row in body]


def _form_faults(header: list[str], body: list[Row], place: str) -> list[Fault]:
    """Faults of column names and of rows of the wrong length."""
    faults = []
    for name in dict.fromkeys(header):
        if not name:
            faults.append(Fault(place, f"column {header.index(name) + 1} has no name"))
        elif header.count(name) > 1:
            faults.append(Fault(place, f"column {name} appears {header.count(name)} times"))
    if not body:
        faults.append(Fault(place, "has no rows below its column names"))
    wrong = [(at, len(row)) for at, row in body if len(row) != len(header)]
    text = f"{len(header)} cells expected, as many as there are column names, got"
    faults += [Fault(f"{place}: row {at}", f"{text} {count}") for at, count in wrong[:SHOWN]]
    if len(wrong) > SHOWN:
        faults.append(Fault(place, f"{len(wrong) - SHOWN} more rows of another length"))
    return faults


def _missing_notes(name: str, cells: Any, lines: list[int], values: NDArray[Any] | None) -> list[str]:
    """A note on the cells of a column of numbers that hold no number."""
    if values is None:
        values = np.asarray(pd.to_numeric(pd.Series(cells, dtype=object), errors="coerce"))
    bad = np.flatnonzero(np.isnan(values)).tolist()
    if not bad:
        return []
    listed = ", ".join(f'row {lines[at]} "{cells[at]}"' for at in bad[:5])
    more = ", ..." if len(bad) > 5 else ""
    return [f"{name}: {len(bad)} cells hold no number: {listed}{more}"]
