"""What files state in the place of a configuration: prices by variable or part, and measured parts.

The columns of a cost file: `variable` or `part`, `process` (of a process or machine) where there are any, `t` or
`grade`, and `cost`; units in the header, `t [um]`, `cost [EUR]`.
"""

from __future__ import annotations

import copy
import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import tables
from ..errors import Fault, InputError, nearest, raise_all, refuse
from ..models.cost_reading import EXTRAS
from ..models.iso286 import GRADES
from ..units import converted, dimension, fits, split_unit, to_unit

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("variable", "part", "process", "t", "grade", "cost")
_HEADER = re.compile(r"^\s*(\w+?)\s*(?:\[([^\]]*)\]|\(([^)]*)\))?\s*$")
OPTIONS = ("encoding", "delimiter", "decimal", "shape")
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
    """Encoding, delimiter, decimal sign and shape that a table states for its file; they are taken from it."""
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
        cost_table = tables.open_or_raise(folder / name, name, options)
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
        text = f'is missing, as {name} states its costs in "{currency}": write currency = "{currency}"'
        if isinstance(stated, str):
            text = f'contradicts {name}, whose costs are in "{currency}": the configuration states "{stated}"'
        faults.append(Fault("currency", text))
    return None if wrong else Prices(rows, place, units.get("t", ""), currency)


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
            number = tables.number_in(text)
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


# `[costs] file` and `[part.costs] file`: prices from a table, put into the configuration.
#
# The contents of the file (see `cost_rows`) replace its name in the tables of the configuration,
# which are then read as if the contents were written there.


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
    for name, rows in _rows_by_name(prices, "variable", faults):
        variable = variables.get(name) if isinstance(variables, dict) else None
        machines = {machine.get("name"): machine for _, machine in tables_in(variable or {}, "machine")}
        for process, some in _group_rows(rows, "process").items():
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
    for name, rows in _rows_by_name(prices, "part", faults):
        if name not in parts:
            text = f'"{name}" of the file is not a part{nearest(name, map(str, parts))}'
            faults.append(Fault(prices.place, text))
            continue
        at, part = parts[name]
        _fill_part(filled, part, at, replace(prices, rows=rows), faults)


def _rows_by_name(prices: Prices, key: str, faults: list[Fault]) -> Iterator[tuple[str, list[Raw]]]:
    """Rows by variable or part."""
    groups = _group_rows(prices.rows, key)
    if None in groups:
        faults.append(Fault(prices.place, f"column {key} is missing or empty: it states what each cost is of"))
    for name, rows in groups.items():
        if name is not None:
            yield name, rows


def _group_rows(rows: list[Raw], key: str) -> dict[str | None, list[Raw]]:
    groups: dict[str | None, list[Raw]] = {}
    for row in rows:
        groups.setdefault(row.get(key), []).append(row)
    return groups


def _fill_part(filled: Filled, part: Raw, at: int, prices: Prices, faults: list[Fault]) -> None:
    """Prices of one part: of its processes and machines, by grade, or as a table of t."""
    owners = {owner.get("name"): owner for key in ("process", "machine") for _, owner in tables_in(part, key)}
    machines = {machine.get("name") for _, machine in tables_in(part, "machine")}
    name, unit = str(part.get("name", at)), unit_of(filled.table, part)
    for process, rows in _group_rows(prices.rows, "process").items():
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
    values = [tables.number_in(str(row.get(key, "")).removeprefix("IT" if key == "grade" else "")) for row in rows]
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


# `measured` tables of parts, variables and machines, filled in from their files.


_TRIAL = re.compile(r"[ _#.\-]*\d+$")
LISTED = 40
"""Characteristics of a file that a fault lists."""
REVISED = {
    "nominal": "nominal sizes",
    "unit": "units",
    **dict.fromkeys(("made_to", "lower", "upper"), "limits"),
    "mid": "middles of the limits",
}
"""What files of one characteristic must have in common."""


def fill_files(table: Raw, folder: Path, faults: list[Fault]) -> Filled:
    """The tables of a run with the contents of the files that they name, relative to `folder`:
    costs and measured parts. Faults are added to `faults`.
    """
    filled = Filled(copy.deepcopy(table))
    fill_measured(filled, folder, faults)
    fill_costs(filled, folder, faults)
    return filled


def fill_measured(filled: Filled, folder: Path, faults: list[Fault]) -> None:
    """Put the values of every file of measured parts in its place; faults are added to `faults`.

    Lots and other groups, nominal and half the distance of the limits (`made_to`) of a file are
    taken over where the configuration does not state them, and the limit where only one is none of
    nature. A file of a gauge study is read in the same way.
    """
    for owner_place, owner, part in _owners(filled.table):
        measured = owner.get("measured")
        if isinstance(measured, dict) and isinstance(measured.get("gauge"), dict) and "file" in measured["gauge"]:
            place = f"{owner_place}.measured.gauge.file"
            measured["gauge"] = _gauge_study(measured["gauge"], measured, part, folder, place, faults)
        if isinstance(measured, dict) and "file" in measured:
            place = f"{owner_place}.measured.file"
            names = measured.pop("file")
            names = [names] if isinstance(names, str) else names
            options = options_in(measured, _sizes(measured, part, unit_of(filled.table, part)))
            if not (isinstance(names, list) and names and all(isinstance(name, str) for name in names)):
                faults.append(Fault(place, f"must be the name of a file, or a list of them, got {names}"))
                continue
            if "values" in measured:
                faults.append(Fault(place, "is given in addition to values: keep only one of them"))
                continue
            wanted, before = measured.get("characteristic"), len(faults)
            contents = [_read(folder / name, wanted, options, place, faults) for name in names]
            read = [(values, name) for values, name in zip(contents, names, strict=True) if values is not None]
            filled.notes += [note for values, _ in read for note in values.pop("notes", ())]
            samples = [values for values, _ in read]
            for values, name in read:
                if values.pop("study", None):
                    text = f"{name} is a gauge study (K2202), in which parts are measured again and again: gauge"
                    faults.append(Fault(place, f"{text} = {{ file = ... }} reads it"))
            if "made_to" in measured:  # limits of the drawing may have changed since
                dropped = ("made_to", "mid", "lower", "upper")
                samples = [{k: v for k, v in one.items() if k not in dropped} for one in samples]
            sample = join_characteristics(samples, [name for _, name in read], place, faults)
            if len(faults) > before:
                measured["values"] = None  # no further faults are reported for them
                continue
            owner["measured"] = sample | measured


def _gauge_study(gauge: Raw, measured: Raw, part: Raw, folder: Path, place: str, faults: list[Fault]) -> Raw:
    """The table of a gauge with the measurements of its study, their parts and operators."""
    name, options = gauge.pop("file"), options_in(gauge, _sizes(measured, part, str(part.get("unit", ""))))
    wanted = gauge.get("characteristic", measured.get("characteristic"))
    if not isinstance(name, str):
        faults.append(Fault(place, f"must be the name of a file, got {name}"))
    elif (read := _read(folder / name, wanted, options, place, faults, "characteristic" not in gauge)) is not None:
        operators = read.get("groups", {}).get("operator", [])
        study = {"values": read["values"], "parts": read.get("parts", []), "operators": operators}
        study |= read.get("study", {})
        if "fault" in study:
            faults.append(Fault(place, study["fault"]))
            return {**gauge, "values": None}
        return study | ({"unit": read["unit"]} if "unit" in read else {}) | gauge
    return {**gauge, "values": None}


def _sizes(measured: Raw, part: Raw, unit: str) -> dict[str, tuple[float, str]]:
    """The nominal size of measured parts with its unit; empty where none is stated."""
    nominal: Any = measured.get("nominal", part.get("nominal"))
    if "nominal" in measured and isinstance(measured.get("unit"), str):
        unit = measured["unit"]
    try:
        return {"": (to_unit(nominal, unit) if isinstance(nominal, str) else float(nominal), unit)}
    except (TypeError, ValueError):
        return {}


def _owners(table: Raw) -> Iterator[tuple[str, Raw, Raw]]:
    """Every table that may have a table `measured`, with its place and the table of its nominal size:
    parts, variables, machines.
    """
    for at, part in tables_in(table, "part"):
        yield f"part[{at}]", part, part
        for number, machine in tables_in(part, "machine"):
            yield f"part[{at}].machine[{number}]", machine, part
    variables = table.get("variables")
    for name, variable in (variables if isinstance(variables, dict) else {}).items():
        if not isinstance(variable, dict):
            continue
        yield f"variables.{name}", variable, {}
        for number, machine in tables_in(variable, "machine"):
            yield f"variables.{name}.machine[{number}]", machine, {}


def _read(
    path: Path, wanted: Any, options: tables.ReadOptions, place: str, faults: list[Fault], trials: bool = False
) -> Raw | None:
    """A characteristic of a file; of a gauge study, all columns of its `trials` ("Trial1", "Trial2") together."""
    try:
        opened = opened_parts(path, options)
        if trials and str(wanted) not in opened.names:
            wanted = None  # that of the measured parts
        stems = {_TRIAL.sub("", label) for label in opened.labels}
        if not trials or wanted is not None or len(opened.labels) < 2 or len(stems) > 1:
            return opened.characteristic(wanted)
        every = [opened.values(label) for label in opened.labels]
        operators = [name for one in every for name in one.get("groups", {}).get("operator", ())]
        together = {key: [x for one in every for x in one.get(key, ())] for key in ("values", "parts")}
        return every[0] | together | ({"groups": {"operator": operators}} if operators else {})
    except InputError as error:
        faults += [Fault(place, f"{fault.place} {fault.message}") for fault in error.faults]
        return None


def join_characteristics(characteristics: list[Raw], names: Sequence[str], place: str, faults: list[Fault]) -> Raw:
    """The values of several files of one characteristic, in their order, a file without
    lots being one lot. Files of different revisions of the drawing, or units, are a fault.
    """
    for characteristic in characteristics:
        characteristic.pop("parts", None)  # parts come again in a gauge study alone
    if len(characteristics) < 2:
        return characteristics[0] if characteristics else {}
    for key, what in REVISED.items():
        having = [(one[key], name) for one, name in zip(characteristics, names, strict=True) if key in one]
        # Limits and deviations of one drawing differ by rounding.
        stated = {f"{value:.9g}" if isinstance(value, float) else str(value): name for value, name in having}
        if len(stated) > 1:
            listed = ", ".join(f"{value} in {name}" for value, name in stated.items())
            text = f"mixes files of different {what} ({listed}): give files of one revision of the drawing"
            faults.append(Fault(place, text))
    whole: Raw = {}
    for characteristic in characteristics:
        whole |= characteristic
    whole["values"] = [value for part in characteristics for value in part["values"]]
    whole["lots"] = []
    for characteristic, name in zip(characteristics, names, strict=True):
        whole["lots"] += characteristic.get("lots") or [Path(name).stem] * len(characteristic["values"])
    kinds = set.intersection(*(set(part.get("groups", ())) for part in characteristics))
    whole["groups"] = {kind: [n for part in characteristics for n in part["groups"][kind]] for kind in sorted(kinds)}
    return {key: value for key, value in whole.items() if key != "groups" or value}


@dataclass(frozen=True)
class MeasuredFile:
    """A file of measured parts, opened once: the labels of its characteristics, the label by every
    name that a characteristic may be requested by, and the values by label; `numbers` are the labels
    by the numbers of part and characteristic in a Q-DAS file.
    """

    place: str
    labels: tuple[str, ...]
    names: Mapping[str, str]
    values: Callable[[str], Raw]
    numbers: Mapping[tuple[str, str], str] = field(default_factory=dict)

    def characteristic(self, wanted: Any) -> Raw:
        """The characteristic that is wanted, or the only one; raises InputError without it."""
        if wanted is None and len(self.labels) == 1:
            return self.values(self.labels[0])
        if str(wanted) in self.names and self.labels and wanted is not None:
            return self.values(self.names[str(wanted)])
        text, listed = f'has no characteristic "{wanted}"{nearest(str(wanted), self.names)}', self.labels
        if not self.labels:
            text, listed = "has no column of measured values", tuple(dict.fromkeys(self.names.values()))
        elif wanted is None:
            text = f"has {len(self.labels)} characteristics: state which one is meant, characteristic = ..."
        more = f", ... ({len(listed)} in all)" if len(listed) > LISTED else ""
        raise refuse(self.place, f"{text}; it has {', '.join(listed[:LISTED])}{more}")


def opened_parts(path: Path, options: tables.ReadOptions) -> MeasuredFile:
    """A file of measured parts. Raises InputError where it is not there, or cannot be read."""
    if path.suffix.lower() in tables.AQDEF_SUFFIXES:
        return _open_aqdef(path, options)
    table = tables.open_or_raise(path, path.name, options)
    names = {name: name for name in table.columns.names}
    names |= {table.headers.get(name, name): name for name in table.columns.names}
    labels = table.columns.names
    if len(labels) > 1:
        labels = [name for name in labels if name in table.units or _measures(table.frame[name])]
        measured = [name for name in labels if name in table.units or not tables.group_of(name)]
        labels = measured or labels

    def values(name: str) -> Raw:
        numbers, lines = _numbers(table, name, path.name)
        unit = table.units.get(name, "")
        notes = [note for note in table.lines(path.name)[2:] if "hold no number" not in note]
        if missing := len(table.columns) - len(numbers):
            notes.append(f"{path.name}: {missing} of {len(table.columns)} values of {name} are missing, and left out")
        stated = {"values": numbers, "notes": notes} | ({"unit": unit} if unit else {})
        labels = table.cells.loc[lines]
        groups = {kind: column for column in map(str, labels) if column != name and (kind := tables.group_of(column))}
        named = {kind: labels[column].astype(str).tolist() for kind, column in groups.items()}
        stated |= {"parts": named.pop("part")} if "part" in named else {}
        specification = table.specifications.get(name)
        limits = {} if specification is None else _limits_of(specification)
        return stated | _groups_of(named) | limits

    return MeasuredFile(path.name, tuple(labels), names, values)


def _measures(column: pd.Series[Any]) -> bool:
    """Whether a column holds a number, and does not just count its rows (1, 2, 3, ...)."""
    import pandas as pd

    values = pd.to_numeric(column, errors="coerce").to_numpy(dtype=float)
    return bool(np.any(np.isfinite(values)) and not np.all(np.diff(values) == 1.0))


def _groups_of(named: dict[str, list[str]]) -> Raw:
    """The lots of values, and their other groups, without those that name one thing alone."""
    named = {kind: labels for kind, labels in named.items() if len(set(labels)) > 1}
    lots = {"lots": named.pop("lot")} if "lot" in named else {}
    return lots | ({"groups": named} if named else {})


def _limits_of(stated: tables.Specification) -> Raw:
    """Nominal size, half the distance of the limits, and the limit where only one is none of nature."""
    known: Raw = {} if stated.nominal is None else {"nominal": stated.nominal}
    ends = {"lower": stated.lower, "upper": stated.upper}
    limits = {side: end for side, end in ends.items() if end is not None and side != stated.natural}
    if stated.lower is not None and stated.upper is not None and limits:
        known["made_to"] = 0.5 * (stated.upper - stated.lower)
        known["mid"] = round(0.5 * (stated.upper + stated.lower), 12)
    return known | (limits if len(limits) == 1 else {})


def _numbers(table: tables.Table, name: str, place: str) -> tuple[list[float], list[int]]:
    """The numbers of a column and their lines; cells that are empty, or mark a missing value, are
    left out.

    Raises InputError with a fault for every cell that holds anything else.
    """
    import pandas as pd

    numbers, lines, bad = [], [], {}
    for line, cell, value in zip(table.columns.lines, table.cells[name], table.frame[name], strict=True):
        number = tables.number_in(value)
        if math.isfinite(number):
            numbers.append(number)
            lines.append(line)
        elif not (pd.isna(cell) or tables.is_missing(str(cell).strip())):
            bad[line] = f'must be a finite number, or empty where there is none, got "{cell}"'
    raise_all(tables.cell_faults(place, table.headers.get(name, name), bad))
    return numbers, lines


def _open_aqdef(path: Path, options: tables.ReadOptions) -> MeasuredFile:
    read = tables.read_aqdef(path, options.encoding, times=False)
    known = {name: c for name, c in zip(tables.names_of_characteristics(read), read, strict=True) if not c.attributive}
    keys = [(key, name) for name, c in known.items() for key in {c.number, c.name, c.label, name} if key]
    count = Counter(key for key, _ in keys)
    names = {key: name for key, name in keys if count[key] == 1 or key == name}
    numbers = {(c.part_number, c.number): name for name, c in known.items() if c.number}
    return MeasuredFile(path.name, tuple(known), names, lambda name: _values(known[name], path.name), numbers)


def _values(characteristic: tables.Characteristic, place: str) -> Raw:
    """What a Q-DAS file says of a characteristic."""
    kept = [at for at, value in enumerate(characteristic.values) if value is not None]
    numbers = [float(characteristic.values[at] or 0.0) for at in kept]
    values: Raw = {"values": numbers, "characteristic": characteristic.label}
    notes = [f"{place}: {characteristic.label}: {text}" for text in characteristic.denied]
    if missing := len(characteristic.values) - len(kept):
        what = f"values of {characteristic.label} are missing or not valid (K0002), and left out"
        notes.append(f"{place}: {missing} of {len(characteristic.values)} {what}")
    if notes:
        values["notes"] = notes
    try:
        if (study := characteristic.study) is not None:
            named = zip(("parts", "operators"), study, strict=True)
            values["study"] = {key: [labels[at] for at in kept] for key, labels in named}
    except ValueError as error:
        values["study"] = {"fault": f"{place}: {characteristic.label} {error}"}
    reference = tables.number_in(characteristic.keys.get("K2213", "").replace(",", "."))
    if characteristic.keys.get("K2202") == "1" and reference > 0.0:
        values["study"] = {"reference": reference}
    groups = {"lot": characteristic.batches} | characteristic.groups
    values |= _groups_of({kind: [labels[at] for at in kept] for kind, labels in groups.items()})
    if characteristic.unit:
        values["unit"] = characteristic.unit
    return values | _limits_of(characteristic.specification)
