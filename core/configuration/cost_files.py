"""`[costs] file` and `[part.costs] file`: prices from a table, put into the configuration.

The contents of the file (see `cost_rows`) replace its name in the tables of the configuration,
which are then read as if the contents were written there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import Fault, nearest
from ..models.costs.extras import EXTRAS
from ..models.iso286 import GRADES
from ..units import converted, dimension, fits, split_unit
from .cost_rows import OPTIONS, Filled, Prices, Raw, number_in, options_in, read_prices


def fill_costs(filled: Filled, folder: Path, faults: list[Fault]) -> None:
    """Put every cost file in its place; what is wrong is added to `faults`."""
    before = len(faults)
    costs = filled.table.get("costs")
    stack = filled.table.get("problem") == "stack"
    if isinstance(costs, dict) and "file" in costs:
        name, options = costs.pop("file"), options_in(costs)
        if (prices := read_prices(name, options, folder, "costs.file", filled, faults)) is not None:
            (_fill_parts if stack else _fill_variables)(filled, prices, faults)
    for at, part in tables_in(filled.table, "part"):
        part_costs = part.get("costs")
        if not isinstance(part_costs, dict):
            continue
        place = f"part[{at}].costs"
        faults += [
            Fault(f"{place}.{key}", "is not a known key: costs of a part are a file")
            for key in part_costs
            if key not in ("file", *OPTIONS)
        ]
        del part["costs"]
        if "file" not in part_costs:
            faults.append(Fault(f"{place}.file", "is missing: name a table of costs"))
            continue
        options = options_in(part_costs)
        if (prices := read_prices(part_costs["file"], options, folder, f"{place}.file", filled, faults)) is not None:
            part_rows = [row for row in prices.rows if row.get("part") in (None, part.get("name"))]
            _fill_part(filled, part, at, replace(prices, rows=part_rows), faults)
    if isinstance(costs, dict) and stack and not costs:
        del filled.table["costs"]
    if len(faults) > before:
        _stand_in(filled.table)


def _stand_in(table: Raw) -> None:
    """Give dummy costs to parts that a faulty file does not price, so that no faults follow."""
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


def _fill_variables(filled: Filled, prices: Prices, faults: list[Fault]) -> None:
    """`[costs.NAME]` of the variables of a file; prices of machines into their tables."""
    costs, variables = filled.table.setdefault("costs", {}), filled.table.get("variables")
    for name, rows in _by(prices, "variable", faults):
        variable = variables.get(name) if isinstance(variables, dict) else None
        machines = {machine.get("name"): machine for _, machine in tables_in(variable or {}, "machine")}
        for process, some in _grouped(rows, "process").items():
            if process is not None and process in machines:
                _price(machines[process], process, some, prices.place, faults)
            elif process is not None:
                text = f'{name} has no machine "{process}"{nearest(process, map(str, machines))}'
                faults.append(Fault(prices.place, text))
            elif isinstance(costs.get(name, {}), dict) and costs.get(name, {}).keys() <= {*EXTRAS}:
                unit = split_unit(name)[1]
                if (curve := _curve(some, prices, unit, name, faults)) is not None:
                    costs[name] = curve | costs.get(name, {})
            else:
                faults.append(Fault(f"costs.{name}", "is stated here and in the file: keep only one of them"))


def _fill_parts(filled: Filled, prices: Prices, faults: list[Fault]) -> None:
    """Costs of parts of a stack."""
    parts = {part.get("name"): (at, part) for at, part in tables_in(filled.table, "part")}
    for name, rows in _by(prices, "part", faults):
        if name not in parts:
            text = f'"{name}" of the file is not a part{nearest(name, map(str, parts))}'
            faults.append(Fault(prices.place, text))
            continue
        at, part = parts[name]
        _fill_part(filled, part, at, replace(prices, rows=rows), faults)


def _by(prices: Prices, key: str, faults: list[Fault]) -> Iterator[tuple[str, list[Raw]]]:
    """Rows by variable or part."""
    groups = _grouped(prices.rows, key)
    if None in groups:
        faults.append(Fault(prices.place, f"column {key} is missing or empty: it states what each cost is of"))
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
    owners = {owner.get("name"): owner for key in ("process", "machine") for _, owner in tables_in(part, key)}
    machines = {machine.get("name") for _, machine in tables_in(part, "machine")}
    name, unit = str(part.get("name", at)), unit_of(filled.table, part)
    for process, rows in _grouped(prices.rows, "process").items():
        of_owner = replace(prices, rows=rows)
        if process is None:
            _fill_table(filled, part, f"part[{at}]", name, of_owner, faults, unit)
        elif process not in owners:
            text = f'part {name} has no process or machine "{process}"{nearest(process, map(str, owners))}'
            faults.append(Fault(prices.place, text))
        elif process in machines:
            _price(owners[process], process, rows, prices.place, faults)
        else:
            place = f"part[{at}].process"
            _fill_table(filled, owners[process], place, f"{name}, {process}", of_owner, faults, unit)


def unit_of(table: Raw, part: Raw) -> str:
    """The unit of a part: its own, or that of the first requirement."""
    unit = part.get("unit")
    required = table.get("requirement")
    if unit is None and isinstance(required, list):
        required = required[0] if required else None
    if unit is None and isinstance(required, dict):
        unit = required.get("unit")
    try:
        dimension(unit if isinstance(unit, str) else "")
    except ValueError:  # a fault where it is stated
        return "mm"
    return unit if isinstance(unit, str) else ""


def _fill_table(
    filled: Filled, owner: Raw, place: str, name: str, prices: Prices, faults: list[Fault], unit: str
) -> None:
    """`cost` or `price` of a part or process."""
    by_grade = [row for row in prices.rows if "grade" in row]
    key = "price" if by_grade else "cost"
    if key in owner:
        faults.append(Fault(f"{place}.{key}", "is stated here and in the file: keep only one of them"))
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
            faults.append(Fault(prices.place, f'{name}: "{grade}" is not a grade{nearest(grade, GRADES)}'))
        prices_by_grade[grade] = row["cost"]
    if len(faults) == before:
        _narrow_grades(filled, owner, name, prices_by_grade)
        owner[key] = prices_by_grade


def _narrow_grades(filled: Filled, owner: Raw, name: str, by_grade: dict[str, float]) -> None:
    """Narrow the range of grades to that with prices in the file; prices beyond it are left out."""
    stated = owner.get("grade")
    if not (isinstance(stated, list) and len(stated) == 2 and all(end in GRADES for end in stated)):
        return
    first, last = (GRADES.index(end) for end in stated)
    priced = [at for at in range(first, last + 1) if GRADES[at] in by_grade]
    for grade in [grade for grade in by_grade if grade in GRADES]:
        if not first <= GRADES.index(grade) <= last:
            del by_grade[grade]
    if len(priced) > 1 and (priced[0], priced[-1]) != (first, last):
        ends = GRADES[priced[0]], GRADES[priced[-1]]
        owner["grade"] = list(ends)
        filled.notes.append(
            f"part {name}: prices are given from {ends[0]} to {ends[1]}; the search from "
            f"{stated[0]} to {stated[1]} is narrowed to them"
        )


def _price(machine: Raw, name: str, rows: list[Raw], place: str, faults: list[Fault]) -> None:
    if len(rows) != 1 or rows[0].keys() & {"t", "grade"}:
        faults.append(Fault(place, f"machine {name} has one price, without t or grade: its scatter does not follow t"))
    elif "price" in machine:
        text = f"the price of machine {name} is stated in the configuration as well: keep only one of them"
        faults.append(Fault(place, text))
    else:
        machine["price"] = rows[0]["cost"]


def _curve(rows: list[Raw], prices: Prices, unit: str, name: str, faults: list[Fault]) -> Raw | None:
    """The table of costs that rows state, in order of t in `unit`."""
    key = "t" if all("t" in row for row in rows) else "grade"
    values = [number_in(str(row.get(key, "")).removeprefix("IT" if key == "grade" else "")) for row in rows]
    if not all(math.isfinite(value) for value in values):
        faults.append(Fault(prices.place, f"{name}: each row needs t (or grade) and cost"))
        return None
    if prices.t_unit and key == "t":
        try:
            dimension(prices.t_unit)
        except ValueError as error:
            faults.append(Fault(prices.place, f"{name}: the unit of t: {error}"))
            return None
        if not unit or not fits(prices.t_unit, unit):
            text = f't is in "{prices.t_unit}", which cannot be stated in "{unit}"'
            faults.append(Fault(prices.place, f"{name}: {text}"))
            return None
        values = [float(converted(value, prices.t_unit, unit)) for value in values]
    order = np.argsort(values, kind="stable").tolist()
    t = [values[at] for at in order]
    twice = sorted({value for value in t if t.count(value) > 1})
    faults += [Fault(prices.place, f"{name}: t = {repeated:g} has two costs") for repeated in twice]
    if len(t) < 2 and not twice:
        faults.append(Fault(prices.place, f"{name}: needs costs at two values of t at least"))
    if len(t) < 2 or twice:
        return None
    return {"model": "table", "t": t, "cost_at": [rows[at]["cost"] for at in order]}
