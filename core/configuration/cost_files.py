"""`[costs] file` and `[part.costs] file`: prices from a table, put into the configuration.

The columns: `variable` or `part`, `process` (of a process or machine) where there are any, `t` or
`grade`, and `cost`; units in the header, `t [um]`, `cost [EUR]`. What the file says takes its place
in the tables of the configuration, which are then read as if it stood there.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .. import tables
from ..errors import Fault, InputError, nearest
from ..models.costs.extras import EXTRAS
from ..models.iso286 import GRADES
from ..units import converted, fits, split_unit

COLUMNS = ("variable", "part", "process", "t", "grade", "cost")
_HEADER = re.compile(r"^\s*(\w+?)\s*(?:\[([^\]]*)\]|\(([^)]*)\))?\s*$")
Raw = dict[str, Any]


@dataclass(frozen=True)
class Prices:
    """Rows of a cost file: names of columns as above, units of `t` and `cost`, place in a fault."""

    rows: list[dict[str, Any]]
    place: str
    t_unit: str = ""
    currency: str = ""


@dataclass
class Filled:
    """Tables with the prices of their files in place, and what should be said of it."""

    table: Raw
    notes: list[str] = field(default_factory=list)


def fill_costs(filled: Filled, folder: Path, faults: list[Fault]) -> None:
    """Put every cost file in its place; what is wrong is added to `faults`."""
    before = len(faults)
    costs = filled.table.get("costs")
    stack = filled.table.get("problem") == "stack"
    if isinstance(costs, dict) and "file" in costs:
        name = costs.pop("file")
        if (prices := _read(name, folder, "costs.file", filled, faults)) is not None:
            (_fill_parts if stack else _fill_variables)(filled, prices, faults)
    for at, part in tables_in(filled.table, "part"):
        part_costs = part.get("costs")
        if not isinstance(part_costs, dict):
            continue
        place = f"part[{at}].costs"
        faults += [
            Fault(f"{place}.{key}", "is not a known key: costs of a part are a file")
            for key in part_costs
            if key != "file"
        ]
        del part["costs"]
        if "file" not in part_costs:
            faults.append(Fault(f"{place}.file", "is missing: name a table of costs"))
            continue
        if (
            prices := _read(part_costs["file"], folder, f"{place}.file", filled, faults)
        ) is not None:
            part_rows = [row for row in prices.rows if row.get("part") in (None, part.get("name"))]
            _fill_part(filled, part, at, replace(prices, rows=part_rows), faults)
    if isinstance(costs, dict) and stack and not costs:
        del filled.table["costs"]
    if len(faults) > before:
        _stand_in(filled.table)


def _stand_in(table: Raw) -> None:
    """Costs of parts for those that a faulty file does not state: they are not missing as well."""
    for _, part in tables_in(table, "part"):
        owners = [process for _, process in tables_in(part, "process")]
        for owner in [*owners, *([part] if "t_min" in part and "machine" not in part else [])]:
            owner.setdefault("cost", {"model": "reciprocal", "a": 1.0, "b": 0.0})
        for _, machine in tables_in(part, "machine"):
            machine.setdefault("price", 0.0)
        if isinstance(part.get("grade"), list) and "price" not in part:
            part.setdefault("cost", {"model": "reciprocal", "a": 1.0, "b": 0.0})


def tables_in(table: Mapping[str, Any], key: str) -> Iterator[tuple[int, Raw]]:
    """The tables of a list of tables, with their places."""
    value = table.get(key)
    for at, entry in enumerate(value if isinstance(value, list) else []):
        if isinstance(entry, dict):
            yield at, entry


# ---------------------------------------------------------------- the file


def _read(
    name: Any, folder: Path, place: str, filled: Filled, faults: list[Fault]
) -> Prices | None:
    """The rows of a file, None and every fault where it cannot be used."""
    if not isinstance(name, str):
        faults.append(Fault(place, f"must be the name of a file, got {name}"))
        return None
    try:
        cost_table = tables.opened_whole(folder / name, name)
    except InputError as error:
        faults += [Fault(place, f"{fault.place} {fault.message}".strip()) for fault in error.faults]
        return None
    columns, units, notes = _columns(cost_table)
    form_faults = [
        Fault(place, f"{name}: column {c} is there twice")
        for c in COLUMNS
        if list(columns.values()).count(c) > 1
    ]
    have = set(columns.values())
    if "cost" not in have:
        form_faults.append(
            Fault(place, f"{name}: column cost is missing{_nearest('cost', cost_table)}")
        )
    if not have & {"t", "grade", "process"}:
        form_faults.append(
            Fault(place, f"{name}: column t or grade is missing: what the costs are for")
        )
    if {"variable", "part"} <= have:
        form_faults.append(
            Fault(place, f"{name}: has a column variable and a column part: keep one")
        )
    if form_faults:
        faults += form_faults
        return None
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
        return f'contradicts {whose}: the configuration says "{stated}"'
    return f'is missing beside {whose}: write currency = "{currency}"'


def _nearest(name: str, cost_table: tables.Table) -> str:
    return nearest(name, [str(column) for column in cost_table.cells])


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
    """Rows with `t` and `cost` as numbers and empty cells left out; what is wrong with them."""
    rows, wrong = [], []
    for line, cell in zip(cells.index, cells.to_dict("records"), strict=True):
        row: dict[str, Any] = {}
        for column, value in cell.items():
            text = "" if value is None or value != value else str(value).strip()
            if column not in ("t", "cost"):
                if text:
                    row[str(column)] = text
                continue
            number = _number(text)
            least = number > 0.0 if column == "t" else number >= 0.0
            if text and not (math.isfinite(number) and least):
                what = "above 0" if column == "t" else "at least 0"
                wrong.append(f'{name}, line {line}: {column} must be a number {what}, got "{text}"')
            elif text:
                row[str(column)] = number
        if "cost" not in row and not any(
            f"line {line}:" in text_of_fault for text_of_fault in wrong
        ):
            wrong.append(f"{name}, line {line}: cost is empty")
        rows.append(row)
    return rows, wrong


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


# ---------------------------------------------------------------- into the configuration


def _fill_variables(filled: Filled, prices: Prices, faults: list[Fault]) -> None:
    """`[costs.NAME]` of the variables of a file; prices of machines into their tables."""
    costs, variables = filled.table.setdefault("costs", {}), filled.table.get("variables")
    for name, rows in _by(prices, "variable", faults):
        variable = variables.get(name) if isinstance(variables, dict) else None
        machines = {
            machine.get("name"): machine for _, machine in tables_in(variable or {}, "machine")
        }
        for process, some in _grouped(rows, "process").items():
            if process is not None and process in machines:
                _price(machines[process], process, some, prices.place, faults)
            elif process is not None:
                faults.append(
                    Fault(
                        prices.place,
                        f'{name} has no machine "{process}"'
                        f"{nearest(process, [str(m) for m in machines])}",
                    )
                )
            elif isinstance(costs.get(name, {}), dict) and costs.get(name, {}).keys() <= {*EXTRAS}:
                unit = split_unit(name)[1]
                if (curve := _curve(some, prices, unit, name, faults)) is not None:
                    costs[name] = curve | costs.get(name, {})
            else:
                faults.append(Fault(f"costs.{name}", "is stated here and in the file: keep one"))


def _fill_parts(filled: Filled, prices: Prices, faults: list[Fault]) -> None:
    """Costs of parts of a stack."""
    parts = {part.get("name"): (at, part) for at, part in tables_in(filled.table, "part")}
    for name, rows in _by(prices, "part", faults):
        if name not in parts:
            text = f'"{name}" of the file is not a part{nearest(name, [str(p) for p in parts])}'
            faults.append(Fault(prices.place, text))
            continue
        at, part = parts[name]
        _fill_part(filled, part, at, replace(prices, rows=rows), faults)


def _by(prices: Prices, key: str, faults: list[Fault]) -> Iterator[tuple[str, list[Raw]]]:
    """Rows by variable or part."""
    groups = _grouped(prices.rows, key)
    if None in groups:
        faults.append(
            Fault(prices.place, f"column {key} is missing or empty: it says what each cost is of")
        )
    for name, rows in groups.items():
        if name is not None:
            yield name, rows


def _grouped(rows: list[Raw], key: str) -> dict[str | None, list[Raw]]:
    groups: dict[str | None, list[Raw]] = {}
    for row in rows:
        groups.setdefault(row.get(key), []).append(row)
    return groups


def _fill_part(filled: Filled, part: Raw, at: int, prices: Prices, faults: list[Fault]) -> None:
    """Prices of one part: of its processes and machines, by grade, or as a table of t."""
    owners = {
        owner.get("name"): owner
        for key in ("process", "machine")
        for _, owner in tables_in(part, key)
    }
    machines = {machine.get("name") for _, machine in tables_in(part, "machine")}
    name = str(part.get("name", at))
    for process, rows in _grouped(prices.rows, "process").items():
        if process is None:
            _fill_table(
                filled,
                part,
                f"part[{at}]",
                name,
                replace(prices, rows=rows),
                faults,
                _unit_of(filled.table, part),
            )
        elif process not in owners:
            faults.append(
                Fault(
                    prices.place,
                    f'part {name} has no process or machine "{process}"'
                    f"{nearest(process, [str(owner) for owner in owners])}",
                )
            )
        elif process in machines:
            _price(owners[process], process, rows, prices.place, faults)
        else:
            _fill_table(
                filled,
                owners[process],
                f"part[{at}].process",
                f"{name}, {process}",
                replace(prices, rows=rows),
                faults,
                _unit_of(filled.table, part),
            )


def _unit_of(table: Raw, part: Raw) -> str:
    unit = part.get("unit")
    required = table.get("requirement")
    if unit is None and isinstance(required, list):
        required = required[0] if required else None
    if unit is None and isinstance(required, dict):
        unit = required.get("unit")
    return unit if isinstance(unit, str) else ""


def _fill_table(
    filled: Filled,
    owner: Raw,
    place: str,
    name: str,
    prices: Prices,
    faults: list[Fault],
    unit: str,
) -> None:
    """`cost` or `price` of a part or process."""
    by_grade = [row for row in prices.rows if "grade" in row]
    key = "price" if by_grade else "cost"
    if key in owner:
        faults.append(Fault(f"{place}.{key}", "is stated here and in the file: keep one"))
        return
    if by_grade and len(by_grade) < len(prices.rows):
        faults.append(Fault(prices.place, f"{name} has rows with a grade and rows without one"))
        return
    if not by_grade:
        if (curve := _curve(prices.rows, prices, unit, name, faults)) is not None:
            owner[key] = curve
        return
    prices_by_grade: dict[str, float] = {}
    before = len(faults)
    for row in by_grade:
        grade = row["grade"] if not row["grade"].isdigit() else f"IT{row['grade']}"
        if grade in prices_by_grade:
            faults.append(Fault(prices.place, f"{name}: {grade} has two prices"))
        if grade not in GRADES:
            faults.append(
                Fault(prices.place, f'{name}: "{grade}" is not a grade{nearest(grade, GRADES)}')
            )
        prices_by_grade[grade] = row["cost"]
    if len(faults) == before:
        _narrow_grades(filled, owner, name, prices_by_grade)
        owner[key] = prices_by_grade


def _narrow_grades(filled: Filled, owner: Raw, name: str, by_grade: dict[str, float]) -> None:
    """The range of grades, where the file prices only an inner one; prices beyond are left out."""
    asked = owner.get("grade")
    if not (isinstance(asked, list) and len(asked) == 2 and all(end in GRADES for end in asked)):
        return
    first, last = (GRADES.index(end) for end in asked)
    priced = [at for at in range(first, last + 1) if GRADES[at] in by_grade]
    for grade in [grade for grade in by_grade if grade in GRADES]:
        if not first <= GRADES.index(grade) <= last:
            del by_grade[grade]
    if len(priced) > 1 and (priced[0], priced[-1]) != (first, last):
        ends = GRADES[priced[0]], GRADES[priced[-1]]
        owner["grade"] = list(ends)
        filled.notes.append(
            f"part {name}: prices are given from {ends[0]} to {ends[1]}; the search from "
            f"{asked[0]} to {asked[1]} is narrowed to them"
        )


def _price(machine: Raw, name: str, rows: list[Raw], place: str, faults: list[Fault]) -> None:
    if len(rows) != 1 or rows[0].keys() & {"t", "grade"}:
        faults.append(
            Fault(
                place,
                f"machine {name} has one price, without t or grade: its scatter does not follow t",
            )
        )
    elif "price" in machine:
        faults.append(
            Fault(
                place,
                f"the price of machine {name} is stated in the configuration as well: keep one",
            )
        )
    else:
        machine["price"] = rows[0]["cost"]


def _curve(
    rows: list[Raw], prices: Prices, unit: str, name: str, faults: list[Fault]
) -> Raw | None:
    """The table of costs that rows state, in order of t in `unit`."""
    key = "t" if all("t" in row for row in rows) else "grade"
    values = [
        _number(str(row.get(key, "")).removeprefix("IT" if key == "grade" else "")) for row in rows
    ]
    if not all(math.isfinite(value) for value in values):
        faults.append(Fault(prices.place, f"{name}: each row needs t (or grade) and cost"))
        return None
    if prices.t_unit and key == "t":
        if not unit or not fits(prices.t_unit, unit):
            text = f'{name}: t is in "{prices.t_unit}", which cannot be stated in "{unit}"'
            faults.append(Fault(prices.place, text))
            return None
        values = [float(converted(value, prices.t_unit, unit)) for value in values]
    order = np.argsort(values, kind="stable").tolist()
    t = [values[at] for at in order]
    twice = sorted({value for value in t if t.count(value) > 1})
    for repeated in twice:
        faults.append(Fault(prices.place, f"{name}: t = {repeated:g} has two costs"))
    if len(t) < 2 and not twice:
        faults.append(Fault(prices.place, f"{name}: needs costs at two values of t at least"))
    if len(t) < 2 or twice:
        return None
    return {"model": "table", "t": t, "cost_at": [rows[at]["cost"] for at in order]}
