"""From rows of cells to a table: names, units, decimal signs, and every fault of the form."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray

from ..errors import Fault, InputError, nearest, raise_all, refuse
from ..files import clear_parts, csv_text, restore_cell, write_bytes, write_text
from ..section import is_forced
from ..units import converted, fits, shorten_text
from .header import Layout, Row, find_layout, is_same_unit, known_unit, names_of, split_header, unit_of_cell
from .lines import ENDS, NEAR, Bulk, probed, prove_column, rows_near, rows_of, rows_of_text
from .record import AQDEF_SUFFIXES, AS_DETECTED, LONG, Columns, Dialect, ReadOptions, Table, empty_cells
from .shapes import group_of, role_of, roles_of, specifications_of_rows, transposed_rows, unclear_rows, wide_of_long
from .signs import (
    Evidence,
    Exact,
    canonical,
    canonical_number,
    decide,
    evidence,
    is_label,
    is_missing,
    notation,
    numbers_in,
)
from .text import content_of

SHOWN = 100
"""Bad rows of a table, or bad cells of one column, that are listed; the rest is counted."""


def assemble_table(
    rows: list[Row],
    dialect: Dialect,
    place: str,
    options: ReadOptions,
    bulk: Bulk | None = None,
    notes: Sequence[str] = (),
) -> tuple[Table | None, list[Fault]]:
    """The table in the rows of a file, which are not empty; for a long file, in its bulk."""

    def cell_by_cell() -> tuple[Table | None, list[Fault]]:
        assert bulk is not None
        rows_by_cell = rows_of("\n".join(bulk.lines), bulk.form, place)
        return assemble_table(rows_by_cell, dialect, place, options, notes=notes)

    turned = transposed_rows(rows, options.shape, place)
    layout = find_layout(rows if turned is None else turned, place)
    line = layout.header[0]
    if bulk is not None and (turned is not None or len(heads := bulk.repeated(line)) * 4 * NEAR > len(bulk.lines)):
        return cell_by_cell()
    if bulk is not None and len(heads) > 1:
        rows = rows_near(bulk, heads)
        layout = find_layout(rows, place)
    layout.notes += notes
    if turned is not None:
        layout.notes.append("read as: a column per part; the number of a row is that of its column")
    header, body = _trim_layout(layout)
    titled = len(set(layout.blocks)) > 1 and "block" not in header
    if titled:
        header = [*header, "block"]
        body = [(at, [*row, title]) for (at, row), title in zip(body, layout.blocks, strict=True)]
    if dialect.kind == "csv" and dialect.delimiter != " ":
        body = _fill_short_rows(header, body, layout)
    faults = [*layout.faults, *_form_faults(header, body, place)]
    whole = [row for row in body if len(row[1]) == len(header)] if faults else body
    lines: Sequence[int] = [at for at, _ in whole]
    columns: list[Any] = [list(cells) for cells in zip(*(row for _, row in whole), strict=True)]
    if bulk is not None:
        known, lines = lines, range(lines[0], lines[-1] + 1)
        if layout.blocks:
            seen = {at for at, _ in rows}.difference(known)
            lines = [at for at in lines if at not in seen and bulk.lines[at - 1].strip()]
        arrays = None if faults else bulk.columns(lines, len(header) - titled)
        if arrays is None:
            return cell_by_cell()
        if titled:
            arrays.append(pa.array(columns[-1]).take(np.searchsorted(known, lines, "right") - 1))
        columns = arrays
    elif dialect.kind != "xlsx" and len(lines) > 3 * ENDS:  # cells of a workbook are exact
        columns = [pa.array(cells, pa.string()) for cells in columns]
    names, units = names_of(header), _units(layout, header)
    headers = {names[name]: name for name in header}
    cells_of: dict[str, Any] = {}
    for name, cells in zip(header, columns or [[] for _ in header], strict=True):
        cells_of.setdefault(names[name], cells)
    of_cells = _strip_units(cells_of)
    contradicted = [name for name, unit in of_cells.items() if not is_same_unit(units.get(name, unit), unit)]
    text = "has cells in {}, and another unit in its name"
    faults += [Fault(f"{place}: column {headers[n]}", text.format(of_cells[n])) for n in contradicted]
    units |= of_cells
    proofs, values = _proofs(cells_of)
    delimiter = dialect.delimiter if dialect.kind == "csv" else ""
    signs, doubts = decide(
        proofs, options.decimal, delimiter, place, partial(_is_near_nominal, options, units, headers)
    )
    notes = [*layout.notes]
    numeric = []
    for name, cells in cells_of.items():
        cells_of[name] = _canonical_cells(cells, proofs[name], signs.get(name))
        if name in values or (proofs[name].numeric and not any(map(is_label, cells_of[name]))):
            numeric.append(name)
            notes += _missing_notes(name, cells_of[name], lines, values.get(name))
    used = {signs[n] for n in cells_of if signs.get(n) and (proofs[n].proven or proofs[n].either)}
    dialect = replace(
        dialect,
        decimal=min(used) if len(used) == 1 else "",
        thousands=next((proof.group for proof in proofs.values() if proof.group), ""),
        header=line,
        unit_row=layout.units[0] if layout.units else 0,
    )

    def number(at: int, cell: str) -> float:
        text = canonical_number(cell, signs.get(names[header[at]]) or ".")
        return float(text or cell) if text or isinstance(cell, Exact) else math.nan

    summaries = [row for _, row in layout.summaries]
    stated, wrong = specifications_of_rows(summaries, [names[name] for name in header], number, place)
    columns_of_names = Columns(cells_of, lines)
    wide = Table(columns_of_names, dialect, units, tuple(notes), tuple(numeric), headers, values, stated)
    faults += _unnamed_rows(wide, place)
    faults += unclear_rows(wide, place)
    wide, of_shape = (wide, []) if faults else wide_of_long(wide, place, options.shape)
    natural = {
        name: replace(limits, natural="lower")
        for name, limits in wide.specifications.items()
        if limits.lower == limits.nominal == 0.0 and not (pd.to_numeric(wide.cells[name], errors="coerce") < 0.0).any()
    }
    wide = replace(wide, specifications=dict(wide.specifications) | natural)
    return wide, faults + doubts + wrong + of_shape


def _unnamed_rows(table: Table, place: str) -> list[Fault]:
    """A fault where a few rows name no part, or no characteristic: statistics that lost their name.

    Columns that are called so name the rows; so does a first column of different texts, or of numbers
    that count the rows, above rows at the end that it leaves empty.
    """
    faults = []
    for at, (name, cells) in enumerate(table.columns.cells.items()):
        what = role_of(name)
        names_rows = what in ("part", "characteristic")
        if not (names_rows or at == 0) or not 0 < 2 * len(blank := empty_cells(cells)) < len(cells):
            continue
        if names_rows or (len(cells) - blank[0] == len(blank) and _names_rows([*map(str, cells[: blank[0]])])):
            others = "" if len(blank) == 1 else f", nor do {len(blank) - 1} other rows"
            text = f"names no {what or 'part'} (column {name}), as most rows do{others}: name it, or remove the row"
            faults.append(Fault(f"{place}: row {table.columns.lines[blank[0]]}", text))
    return faults


def _names_rows(cells: Sequence[str]) -> bool:
    """Whether three cells or more are different names, or count the rows: 1, 2, 3, ..."""
    if all(cell.isdecimal() for cell in cells):
        return len(cells) > 2 and all(int(after) == int(before) + 1 for before, after in pairwise(cells))
    return len(set(cells)) == len(cells) > 2 and not any(canonical_number(cell, ".") for cell in cells)


def _fill_short_rows(header: list[str], body: list[Row], layout: Layout) -> list[Row]:
    """Rows whose last cells are left away because they are empty, filled up.

    That is certain where no row of the file ends in an empty cell, and where every cell that is
    there fits its column: numbers in the range of the column, text where it has text.
    """
    count = len(header)
    whole = [row for _, row in body if len(row) == count]
    short = [(at, row) for at, row in body if 1 < len(row) < count]
    if not whole and len({len(row) for _, row in body}) == 1 and _are_measured(header, body[0][1]):
        layout.notes.append(f"no row has the last {count - len(body[0][1])} cells: empty")
        return [(at, row + [""] * (count - len(row))) for at, row in body]
    alone = body[-1][0] == short[-1][0] if short else False  # a last row that is the only one of its length is cut off
    alone = alone and [len(row) for _, row in short].count(len(short[-1][1])) == 1
    if not short or len(whole) < 2 or any(not row[-1] for row in whole) or alone:
        return body
    columns = list(zip(*whole, strict=True))
    ranges = [_range(cells) for cells in columns]
    for _, row in short:
        for cell, limits in zip(row, ranges, strict=False):
            value = _range([cell])
            if cell and not is_missing(cell) and (value is None) != (limits is None):
                return body
            if value is not None and limits is not None and not limits[0] <= value[0] <= limits[1]:
                return body
    layout.notes.append(f"{len(short)} short rows have no cells at their end: empty (the first is row {short[0][0]})")
    return [(at, row + [""] * (count - len(row)) if 1 < len(row) < count else row) for at, row in body]


def _are_measured(header: list[str], row: list[str]) -> bool:
    """Whether a row that is shorter than the names has numbers where measurements and nominal sizes are named."""
    cells = dict(zip(roles_of(header), row, strict=False))
    numbers = [cells[role] for role in ("value", "nominal") if role in cells]
    return len(row) < len(header) and "characteristic" in cells and len(numbers) == 2 and all(map(notation, numbers))


def _range(cells: Sequence[str]) -> tuple[float, float] | None:
    """The range of numbers in cells, widened by itself on both sides; None where they are no numbers."""
    numbers = [float(text) for cell in cells if (text := canonical_number(cell, ",") or canonical_number(cell, "."))]
    if not numbers:
        return None
    low, high = min(numbers), max(numbers)
    return 2.0 * low - high, 2.0 * high - low


_WITH_UNIT = re.compile(r"([+\-−]?[\d.,]+(?:[eE][+\-−]?\d+)?)( ?(?:%|°|mm|[uµμ]m)| [^\W\d_][^\s\d]*)")
"""A number and its unit; "1A" is a label."""


def _strip_units(cells_of: dict[str, Any]) -> dict[str, str]:
    """Take the unit off the numbers of columns that have one unit in every cell; those units by name."""
    units = {}
    for name, cells in cells_of.items():
        probes = cells if isinstance(cells, list) else probed(cells)
        first = next((match for cell in probes if (match := _WITH_UNIT.fullmatch(cell))), None)
        if first is None or not (unit := known_unit(first[2])) or group_of(name):
            continue
        texts = cells if isinstance(cells, list) else cells.to_pylist()
        matches = [_WITH_UNIT.fullmatch(cell) for cell in texts]
        if all(m[2] == first[2] if m else is_missing(cell) for m, cell in zip(matches, texts, strict=True)):
            units[name] = unit
            cells_of[name] = [m[1] if m else cell for m, cell in zip(matches, texts, strict=True)]
    return units


def _proofs(cells_of: dict[str, Any]) -> tuple[dict[str, Evidence], dict[str, NDArray[Any]]]:
    """What the cells of each column prove, and the numbers of those that are read at once."""
    proofs, numbers = {}, {}
    for name, cells in cells_of.items():
        quick = None if isinstance(cells, list) else prove_column(cells)
        if quick is None:
            cells_of[name] = cells if isinstance(cells, list) else cells.to_pylist()
            quick = evidence(cells_of[name]), None
        proofs[name] = quick[0]
        if quick[1] is not None:
            numbers[name] = quick[1]
    return proofs, numbers


def _canonical_cells(cells: Any, proof: Evidence, sign: str | None) -> Any:
    """The cells of a column with numbers in plain notation."""
    if sign is None or not isinstance(cells, list):
        return cells
    plain = not (sign == "," or proof.group or proof.grouping or proof.either or any("−" in cell for cell in cells))
    return cells if plain else canonical(cells, sign or ".")


def _units(layout: Layout, header: list[str]) -> dict[str, str]:
    """The units that names or a row of units state, by the name without them."""
    names = names_of(header)
    units = {names[n]: unit for n in header if (unit := split_header(n)[1]) and names[n] != n}
    if layout.units is not None:
        for name, cell in zip(header, layout.units[1], strict=False):
            if cell and (unit := unit_of_cell(cell) or "1") != "1":
                units.setdefault(names[name], unit)
    return units


def _is_near_nominal(
    options: ReadOptions, units: Mapping[str, str], headers: Mapping[str, str], name: str, value: float
) -> bool:
    """Whether a value is between half and twice the nominal size of its column, where that is known."""
    nominal, unit = next((options.sizes[key] for key in (headers[name], name, "") if key in options.sizes), (0.0, ""))
    stated = units.get(name)
    if stated and unit and fits(stated, unit):
        value = float(converted(value, stated, unit))
    return 0.5 <= value / nominal <= 2.0 if nominal else False


def _trim_layout(layout: Layout) -> tuple[list[str], list[Row]]:
    """The names and the rows without cells at the end that are empty in every row."""
    header = [
        restore_cell(name.removeprefix("#").strip() if at == 0 else name) for at, name in enumerate(layout.header[1])
    ]
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
    text = f"{len(header)} cells expected, as many as there are column names, got"
    wrong = [(at, len(row)) for at, row in body if len(row) != len(header)]
    for kind in dict.fromkeys(count for _, count in wrong):
        rows = [at for at, count in wrong if count == kind]
        more = "" if len(rows) == 1 else f" ({len(rows)} rows, of which this is the first)"
        faults.append(Fault(f"{place}: row {rows[0]}", f"{text} {kind}{more}"))
    return faults


def _missing_notes(name: str, cells: Any, lines: Sequence[int], values: NDArray[Any] | None) -> list[str]:
    """A note on the cells of a column of numbers that hold no number."""
    if values is None:
        values = np.asarray(pd.to_numeric(pd.Series(cells, dtype=object), errors="coerce"))
    bad = np.flatnonzero(np.isnan(values)).tolist()
    if not bad:
        return []
    listed = ", ".join(f'row {lines[at]} "{cells[at]}"' for at in bad[:5])
    more = ", ..." if len(bad) > 5 else ""
    return [f"{name}: {len(bad)} cells hold no number: {listed}{more}"]


# One entry to every table: text, workbook or Parquet, as they come.


PARQUET = (".parquet", ".pq")
WORKBOOKS = (".xlsx", ".xlsm")
EMPTY = "is empty; it needs a line of column names and one row or more below it"
COLUMNS = 5000
"""Columns of a table at most."""
XLS_SIGNATURE = b"\xd0\xcf\x11\xe0"
"""How workbooks before XLSX begin."""


def read_table(
    path: str | Path,
    encoding: str | None = None,
    delimiter: str | None = None,
    decimal: str | None = None,
    shape: str | None = None,
) -> Table:
    """The table in a file: CSV in any dialect, XLSX or Parquet, with a column per characteristic
    (`shape` "wide"), a row per characteristic ("long") or a column per part ("transposed").

    What is not stated is detected. The table has `frame`, `units`, `specifications`, `dialect` and
    `notes`. Raises InputError with every fault; for an ambiguous file it names the option that decides.
    """
    path = Path(path)
    return open_or_raise(path, path.name, ReadOptions(encoding, delimiter, decimal, shape))


def open_or_raise(path: Path, place: str, options: ReadOptions = AS_DETECTED) -> Table:
    """The table in a file, which faults call `place`. Raises InputError with every fault."""
    table, faults = open_table(path, place, options)
    raise_all(faults)
    assert table is not None
    return table


def open_table(path: Path, place: str, options: ReadOptions = AS_DETECTED) -> tuple[Table | None, list[Fault]]:
    """`open_or_raise` that returns the faults, with what can be read nevertheless.

    Rows of another length are then left out, and all but the first of columns with one name; None
    where not even the column names are known.
    """
    table, faults = _open_by_suffix(path, place, options)
    return table, list(map(options.worded, faults))


def _open_by_suffix(path: Path, place: str, options: ReadOptions) -> tuple[Table | None, list[Fault]]:
    if faults := options.faults():
        return None, faults
    try:
        suffix = path.suffix.lower()
        if suffix in AQDEF_SUFFIXES:
            from .aqdef import table_of_aqdef

            return table_of_aqdef(path, place, options)
        content = content_of(path, place, EMPTY)
        if content.startswith(XLS_SIGNATURE):
            raise refuse(place, "is a workbook of the old format (.xls); save it as .xlsx or CSV")
        if suffix in PARQUET or content[:4] == b"PAR1":
            table, faults = _from_parquet(content, place)
            wide, of_shape = wide_of_long(table, place, options.shape) if options.shape == LONG else (table, [])
            return wide, faults + of_shape
        if suffix in WORKBOOKS or content[:4] == b"PK\x03\x04":
            from .workbook import rows_of_workbook

            (rows, dialect), bulk, notes = rows_of_workbook(content, place), None, list[str]()
        else:
            rows, dialect, bulk, notes = rows_of_text(content, place, options)
        if not rows:
            raise refuse(place, EMPTY)
        if (most := max(len(cells) for _, cells in rows)) > COLUMNS and not is_forced():
            text = f"has {most} columns, {COLUMNS} are the most that are read: leave some out, or add --force"
            raise refuse(place, text)
        return assemble_table(rows, dialect, place, options, bulk, notes)
    except InputError as error:
        return None, list(error.faults)


def _from_parquet(content: bytes, place: str) -> tuple[Table, list[Fault]]:
    try:
        frame = pd.read_parquet(io.BytesIO(content))
    except (OSError, ValueError) as error:
        raise refuse(place, f"is not a Parquet file ({error})") from error
    table, faults = table_of(frame, place, "parquet")
    names = names_of(list(table.headers))
    units = {names[n]: split_header(n)[1] for n in names if names[n] != n}
    columns = Columns({names[str(n)]: frame[n].to_numpy() for n in frame}, range(1, len(frame) + 1))
    headers = {names[n]: n for n in table.headers}
    numeric = tuple(names[n] for n in table.numeric)
    return replace(table, columns=columns, units=units, numeric=numeric, headers=headers), faults


def table_of(frame: pd.DataFrame, place: str, kind: str = "frame") -> tuple[Table, list[Fault]]:
    """A frame as a table, its rows numbered from 1, and its faults."""
    faults = [Fault(place, "has no rows")] if frame.empty else []
    frame = frame.rename(columns=str)
    numeric = tuple(str(n) for n in frame if frame[n].dtype.kind in "fiu")
    headers = {str(name): str(name) for name in frame}
    columns = Columns({str(n): frame[n].to_numpy() for n in frame}, range(1, len(frame) + 1))
    return Table(columns, Dialect(kind, header=0), {}, (), numeric, headers), faults


# Columns of a table in their required types, with every fault and its place.


HEADER = 2**20
"""Bytes of a line of column names at most."""


def write(frame: pd.DataFrame, path: Path) -> None:
    """Write CSV or, by the suffix, Parquet; the index is left out."""
    clear_parts(path)
    if path.suffix.lower() in PARQUET:
        write_bytes(path, frame.to_parquet(index=False))
    else:
        write_text(path, csv_text(frame))


def columns_of(path: Path) -> list[str]:
    """The columns of a table that `write` wrote; none where a file is no such table."""
    from pyarrow import ArrowInvalid
    from pyarrow.parquet import read_schema

    with path.open("rb") as file:
        first = file.readline(HEADER)
    try:
        if first.startswith(b"PAR1"):
            return [str(name) for name in read_schema(path).names]
        return next(csv.reader([first.decode(errors="replace").rstrip("\n")]), [])
    except (ArrowInvalid, OSError, csv.Error):
        return []


def parse_columns(
    frame: pd.DataFrame, place: str, needed: Iterable[str], optional: Iterable[str] = (), text: Iterable[str] = ()
) -> tuple[pd.DataFrame, list[Fault]]:
    """The table with its columns as float64, those in `text` as they are, and a fault for every
    missing or unknown column and every cell that is not a finite number; bad cells are NaN, unknown
    columns are left out.
    """
    needed, text = list(needed), set(text)
    known = list(dict.fromkeys([*needed, *optional]))
    extra = [name for name in frame.columns if name not in known]
    missing = [name for name in needed if name not in frame.columns]
    faults = [Fault(place, f"column {name} is missing") for name in missing]
    free = [name for name in known if name not in frame.columns]
    faults += [Fault(place, f"column {name} is not known{nearest(name, free or known)}; remove it") for name in extra]
    typed = {}
    for name in (name for name in frame.columns if name in known):
        read = _labels if name in text else _numeric
        typed[name], bad = read(frame[name])
        faults += cell_faults(place, name, bad)
    return pd.DataFrame(typed, index=frame.index), faults


def cell_faults(place: str, column: str, bad: dict[Any, str]) -> list[Fault]:
    """A fault per bad cell of a column, by row; beyond `SHOWN` they are counted."""
    shown = list(bad.items())[:SHOWN]
    faults = [Fault(f"{place}: row {at}, column {column}", why) for at, why in shown]
    if len(bad) > SHOWN:
        faults.append(Fault(f"{place}: column {column}", f"{len(bad) - SHOWN} more bad cells"))
    return faults


def _labels(column: pd.Series[Any]) -> tuple[NDArray[Any], dict[Any, str]]:
    """The cells as they are, and which of them are empty, by row."""
    cells = column.to_numpy()
    blank = np.flatnonzero(pd.isna(cells) | (cells == ""))
    return cells, dict.fromkeys(column.index[blank], "is empty")


def _numeric(column: pd.Series[Any]) -> tuple[NDArray[np.float64], dict[Any, str]]:
    """The cells as numbers, NaN where a message says why not, by row."""
    cells = column.to_numpy()
    values = numbers_in(cells)
    bad = np.flatnonzero(~np.isfinite(values)).tolist()
    values[bad] = math.nan
    return values, {column.index[at]: _complaint(cells[at]) for at in bad}


def _complaint(cell: Any) -> str:
    """What is wrong with a cell that holds no finite number."""
    if cell is None or cell == "":
        return "is empty; give a number"
    if str(cell).casefold().lstrip("+-") in ("nan", "inf", "infinity"):
        return f"must be a finite number, got {cell}"
    return f'must be a number, got "{shorten_text(str(cell))}"'
