"""The rows of a cost file: prices by variable or part, and what is wrong with them.

The columns: `variable` or `part`, `process` (of a process or machine) where there are any, `t` or
`grade`, and `cost`; units in the header, `t [um]`, `cost [EUR]`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from .. import tables
from ..errors import Fault, InputError, nearest

COLUMNS = ("variable", "part", "process", "t", "grade", "cost")
_HEADER = re.compile(r"^\s*(\w+?)\s*(?:\[([^\]]*)\]|\(([^)]*)\))?\s*$")
OPTIONS = ("encoding", "delimiter", "decimal")
"""Keys of a table that names a file: what is not to be detected of it."""
Raw = dict[str, Any]


@dataclass(frozen=True)
class Prices:
    """Rows of a cost file by column, its place in faults, and the units of `t` and `cost`."""

    rows: list[dict[str, Any]]
    place: str
    t_unit: str = ""
    currency: str = ""


@dataclass
class Filled:
    """Tables with the prices of their files in place, and notes for the user."""

    table: Raw
    notes: list[str] = field(default_factory=list)


def options_in(table: Raw, sizes: Mapping[str, tuple[float, str]] | None = None) -> tables.ReadOptions:
    """Encoding, delimiter and decimal sign that a table states for its file; they are taken from it."""
    stated = {key: table.pop(key, None) for key in OPTIONS}
    texts = {key: value if value is None else str(value) for key, value in stated.items()}
    return tables.ReadOptions(**texts, where=tables.KEYS, sizes=sizes or {})


def read_prices(
    name: Any, options: tables.ReadOptions, folder: Path, place: str, filled: Filled, faults: list[Fault]
) -> Prices | None:
    """The rows of a file; None, and every fault in `faults`, where it cannot be used."""
    if not isinstance(name, str):
        faults.append(Fault(place, f"must be the name of a file, got {name}"))
        return None
    try:
        cost_table = tables.opened_whole(folder / name, name, options)
    except InputError as error:
        faults += [Fault(place, f"{fault.place} {fault.message}".strip()) for fault in error.faults]
        return None
    columns, units, notes = _columns(cost_table)
    form_faults = [
        Fault(place, f"{name}: column {c} is there twice") for c in COLUMNS if list(columns.values()).count(c) > 1
    ]
    have = set(columns.values())
    if "cost" not in have:
        close = nearest("cost", map(str, cost_table.cells))
        form_faults.append(Fault(place, f"{name}: column cost is missing{close}"))
    if not have & {"t", "grade", "process"}:
        form_faults.append(Fault(place, f"{name}: column t or grade is missing: what the costs are for"))
    if {"variable", "part"} <= have:
        form_faults.append(Fault(place, f"{name}: has a column variable and a column part: keep only one of them"))
    if form_faults:
        faults += form_faults
        return None
    notes += [note for note in cost_table.notes if "hold no number" not in note]
    filled.notes += [f"{name}: {note}" for note in notes]
    cells = cost_table.cells[list(columns)].rename(columns=columns)
    rows, wrong = _rows(cells, name)
    faults += [Fault(place, text) for text in wrong]
    currency = units.get("cost", "")
    stated = filled.table.get("currency")
    if currency and currency != stated:
        faults.append(Fault("currency", _contradiction(name, currency, stated)))
    return None if wrong else Prices(rows, place, units.get("t", ""), currency)


def _contradiction(name: str, currency: str, stated: Any) -> str:
    whose = f'{name}, whose costs are in "{currency}"'
    if isinstance(stated, str):
        return f'contradicts {whose}: the configuration states "{stated}"'
    return f'is missing, as {name} states its costs in "{currency}": write currency = "{currency}"'


def _columns(cost_table: tables.Table) -> tuple[dict[str, str], dict[str, str], list[str]]:
    """Columns of the file by what they are, units, notes on those that are not used."""
    columns: dict[str, str] = {}
    units: dict[str, str] = {}
    unused = []
    for name in map(str, cost_table.cells):
        spelt = str(cost_table.headers.get(name, name))
        match = _HEADER.match(spelt)
        stem = (match[1] if match else spelt).casefold()
        unit = (match[2] or match[3] or "") if match else ""
        if stem not in COLUMNS and stem.rpartition("_")[0] in ("t", "cost"):
            stem, _, unit = spelt.rpartition("_")
            stem = stem.casefold()
        if stem not in COLUMNS:
            unused.append(spelt)
            continue
        columns[name] = stem
        if unit or cost_table.units.get(name):
            units[stem] = unit or cost_table.units[name]
    return columns, units, [f"not used: {', '.join(unused)}"] if unused else []


def _rows(cells: pd.DataFrame, name: str) -> tuple[list[dict[str, Any]], list[str]]:
    """Rows with `t` and `cost` as numbers and empty cells left out, and messages on bad cells."""
    rows, wrong = [], []
    for line, cell in zip(cells.index, cells.to_dict("records"), strict=True):
        row: dict[str, Any] = {}
        messages = []
        for column, value in cell.items():
            text = "" if value is None or value != value else str(value).strip()
            number = number_in(text)
            if not text or column not in ("t", "cost"):
                row |= {str(column): text} if text else {}
            elif math.isfinite(number) and (number > 0.0 if column == "t" else number >= 0.0):
                row[str(column)] = number
            else:
                least = "above 0" if column == "t" else "at least 0"
                messages.append(f'{column} must be a number {least}, got "{text}"')
        if "cost" not in row and not messages:
            messages.append("cost is empty")
        if "t" in row and "grade" in row:
            text = f"has t ({row['t']:g}) and a grade ({row['grade']}): what the cost is for; keep only one of them"
            messages.append(text)
        wrong += [f"{name}, line {line}: {message}" for message in messages]
        rows.append(row)
    return rows, wrong


def number_in(text: str) -> float:
    """The number that a cell states, NaN where it states none."""
    try:
        return math.nan if "_" in text else float(text)
    except ValueError:
        return math.nan
