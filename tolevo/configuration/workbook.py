"""A stack as a workbook (XLSX): its sheets as the tables of a configuration, and its result on sheets beside them."""

from __future__ import annotations

import io
import json
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
import pandas as pd

from ..errors import Fault, InputError
from ..models.costs import CURVES
from ..models.inputs import DISTRIBUTIONS
from ..models.stack.mechanism import mean_of, spread_of
from ..problems.stack.definition import METHODS
from ..problems.stack.problem import Stack
from ..tables.workbook import NOT_A_WORKBOOK, Live, fill, has_formulas, saved

# The sheets: of keys and values, of tables in a list, and of costs.


GENERAL, COSTS = "Stack", "Costs"
LISTS = ("requirement", "part", "fit", "correlation", "matched", "let", "loop", "feature", "condition")
"""Tables in a list, each a row of a sheet of its name in the plural: `[[part]]` on "Parts"."""
ALLOCATION, ANALYSIS = "Allocation", "Analysis"
"""Sheets of the result."""
LIMITS = "limits."
"""How a column of "Requirements" begins that limits an output of the requirement."""
OF_PROCESS = ("t_min", "t_max", "setup", "inspection")
"""Columns of "Costs" that are keys of the part or its process; all others are keys of the cost curve."""
NOTES: Mapping[str, Mapping[str, str]] = {
    GENERAL: {
        "key": "Any key of a configuration, with dots: limits.yield_percent, rounding.steps, algorithm.name.",
        "value": "A number or a text; a list or table as TOML has it: [0.01, 0.02], { a = 1 }.",
    },
    "Requirements": {
        "name": "Of several requirements: letters, digits and _.",
        "unit": "mm, um, rad, deg, ...; of a plain number nothing.",
        "formula": "Of the names of parts; empty where every part has a sensitivity.",
        "nominal": "Value at the nominals; empty: it is computed.",
        "lower": "Lower limit, in the unit of this row.",
        "upper": "Upper limit, in the unit of this row.",
        "method": "What the variation is.",
        "limits.variation": "At most so much variation.",
        "limits.yield_percent": "At least so many percent within lower and upper.",
        "limits.worst_case": "At most so much deviation of any unit.",
    },
    "Parts": {
        "name": "Letters, digits and _; the name in formulas and on the sheet of costs.",
        "unit": "Of nominal and tolerances: mm, um, deg, ...",
        "nominal": "Nominal size.",
        "count": "How often it is built in; empty: once.",
        "sensitivity": "Change of the requirement per change of the part; empty with a formula.",
        "t_min": "Tightest half-width that can be made: the tolerance is searched.",
        "t_max": "Loosest half-width.",
        "tolerance": "Half-width of a part whose tolerance is fixed, in place of t_min and t_max.",
        "grade": "IT6: fixed; in place of tolerance.",
        "distribution": "Normal with Cp = 1 where empty.",
        "cp": "Capability of a normal part.",
    },
    COSTS: {
        "part": "Name of a part of the sheet of parts.",
        "process": "Name of one of several processes of the part, each a row; else empty.",
        "t_min": "Tightest half-width of the process.",
        "t_max": "Loosest half-width of the process.",
        "model": "Cost of half-width t: reciprocal is a + b/t.",
        "a": "Coefficient of the model.",
        "b": "Coefficient of the model.",
        "k": "Exponent of reciprocal_power: a + b/t^k.",
    },
}
"""Columns that a new workbook has, and what each means: a note at its head."""
LINES = 200
"""Rows that drop-down lists reach to at least."""


# From sheets to tables.


@dataclass(frozen=True, slots=True)
class Sheets:
    """The tables of a workbook, where each of their values stands ("Parts!D4" by "part[2].t_max"), and faults."""

    tables: dict[str, Any] = field(default_factory=dict)
    cells: dict[str, str] = field(default_factory=dict)
    faults: list[Fault] = field(default_factory=list)


@lru_cache(maxsize=2)
def read_sheets(content: bytes, place: str) -> Sheets:
    """The tables of a workbook; `place` names it in faults. Raises InputError where it is none, or too large."""
    from openpyxl import load_workbook

    read = Sheets()
    try:
        computed = has_formulas(content, place)
        book = load_workbook(io.BytesIO(content), data_only=True)
        stated = load_workbook(io.BytesIO(content)) if computed else book
    except NOT_A_WORKBOOK as error:
        raise InputError([Fault(place, f"is not a workbook ({error})")]) from error
    titles = {_table_of(sheet.title): sheet.title for sheet in book.worksheets}
    for key in (GENERAL, *LISTS, COSTS):
        if key in titles:
            rows = list(_rows(book[titles[key]], stated[titles[key]], read))
            {GENERAL: _read_general, COSTS: _read_costs}.get(key, _read_list)(rows, key, read)
    if not read.tables and not read.faults:
        read.faults.append(Fault(place, 'needs the sheets "Stack", "Parts" and "Requirements"'))
    read.tables.setdefault("problem", "stack")
    read.tables.setdefault("objectives", {"minimise": ["cost"]})
    read.faults[:] = [Fault(f"{place}: {fault.place}", fault.message) for fault in read.faults]
    return read


def located(error: InputError, content: bytes, place: str) -> InputError:
    """The faults of a workbook's tables with the cells at which they stand, each cell that cannot be read once."""
    read, faults = read_sheets(content, place), list[Fault]()
    cells, unread = read.cells, {fault.place for fault in read.faults}
    for fault in error.faults:
        path = "" if fault.place.startswith(f"{place}: ") else fault.place
        while path and path not in cells:
            path = path[: max(path.rfind("."), path.rfind("["), 0)]
        where = f"{place}: {cells[path]} ({fault.place})" if path else fault.place
        if not path or f"{place}: {cells[path]}" not in unread:
            faults.append(Fault(where, fault.message))
    return InputError(faults)


def _table_of(title: str) -> str:
    """The table that a sheet holds by its title, in any case: "Parts" and "part" are `part`."""
    plain = title.strip().lower()
    known = {name.lower(): name for name in (GENERAL, COSTS, *LISTS)}
    return known.get(plain) or known.get(plain.removesuffix("s")) or title


def _rows(sheet: Any, stated: Any, read: Sheets) -> Iterator[dict[str, tuple[str, Any]]]:
    """The rows below the head of a sheet: by column the place and the value of its cell, None where it is empty."""
    lines = list(zip(sheet.iter_rows(), stated.iter_rows(), strict=True))
    head: dict[int, str] = {}
    for line, written in lines:
        cells = {at: cell for at, cell in enumerate(line) if cell.value is not None and str(cell.value).strip()}
        if not head:
            head = {at: str(cell.value).strip() for at, cell in cells.items()}
            for at, name in head.items():
                if list(head.values()).count(name) > 1:
                    read.faults.append(Fault(f"{sheet.title}!{line[at].coordinate}", f'"{name}" heads two columns'))
            continue
        for at, cell in enumerate(written):
            place = f"{sheet.title}!{cell.coordinate}"
            if at in cells and at not in head:
                read.faults.append(Fault(place, "stands in a column without a heading: name its key in the first row"))
            if cell.data_type == "f" and at not in cells and at in head:
                text = "is a formula without a stored value: open the workbook, let it calculate, and save it"
                read.faults.append(Fault(place, text))
        places = {name: f"{sheet.title}!{line[at].coordinate}" for at, name in head.items()}
        if cells:
            values = {head[at]: _value(cell, sheet.title, read) for at, cell in cells.items() if at in head}
            yield {name: (place, values.get(name)) for name, place in places.items()}


def _value(cell: Any, title: str, read: Sheets) -> Any:
    """A cell as a value of TOML: lists and tables are written in the cell, percentages are texts."""
    value, place = cell.value, f"{title}!{cell.coordinate}"
    if isinstance(value, int | float) and not isinstance(value, bool) and "%" in str(cell.number_format):
        return f"{100.0 * value:.12g} %"
    if cell.data_type == "e":
        read.faults.append(Fault(place, f"holds the error {value} of a formula"))
        return None
    if not isinstance(value, str):
        return value
    text = value.strip()
    if not text.startswith(("[", "{")):
        return text
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except ValueError as error:
        read.faults.append(Fault(place, f'is no list or table of TOML ({error}), got "{text[:80]}"'))
        return None


def _put(table: dict[str, Any], key: str, value: Any, place: str, read: Sheets) -> str:
    """Set a dotted key of a table; the key without quotes."""
    try:
        path = list(_leaf(tomllib.loads(f"{key} = 0")))
    except ValueError:
        read.faults.append(Fault(place, f'is no key, got "{key}"'))
        return key
    inner: Any = table
    for name in path[:-1]:
        inner = inner.setdefault(name, {}) if isinstance(inner, dict) else None
    if isinstance(inner, dict):
        inner[path[-1]] = value
    else:
        read.faults.append(Fault(place, f"{key} leads through a value that is not a table"))
    return ".".join(path)


def _leaf(table: Mapping[str, Any]) -> Iterator[str]:
    """The names on the way to the one value of nested tables."""
    for name, inner in table.items():
        yield name
        if isinstance(inner, dict):
            yield from _leaf(inner)


def _read_general(rows: Sequence[Mapping[str, tuple[str, Any]]], key: str, read: Sheets) -> None:
    for row in rows:
        (place, name), (cell, value) = (row.get(column, ("", None)) for column in ("key", "value"))
        if name is not None and value is not None:
            read.cells[_put(read.tables, str(name), value, place, read)] = cell
        elif value is not None:
            read.faults.append(Fault(cell, "is a value without a key"))


def _read_list(rows: Sequence[Mapping[str, tuple[str, Any]]], key: str, read: Sheets) -> None:
    """Tables in a list; the only row of requirements is a table, and limits are those of the stack."""
    alone = key == "requirement" and len(rows) == 1
    listed: list[dict[str, Any]] = []
    for at, row in enumerate(rows):
        table: dict[str, Any] = {}
        path = key if alone else f"{key}[{at}]"
        read.cells[path] = next(iter(row.values()))[0]
        for column, (place, value) in row.items():
            if key == "requirement" and column.startswith(LIMITS):
                output = column.removeprefix(LIMITS)
                name = output if alone else f"{row.get('name', ('', ''))[1]}.{output}"
                read.cells[f"{LIMITS}{name}"] = place
                if value is not None:
                    read.tables.setdefault("limits", {})[name] = value
                continue
            read.cells[f"{path}.{column}"] = place
            if value is not None:
                _put(table, column, value, place, read)
        listed.append(table)
    if listed:
        read.tables[key] = listed[0] if alone else listed


def _read_costs(rows: Sequence[Mapping[str, tuple[str, Any]]], key: str, read: Sheets) -> None:
    """Costs of parts, or of each of their processes."""
    parts = read.tables.get("part", [])
    names = [part.get("name") for part in parts]
    for row in rows:
        place, name = row.get("part", (next(iter(row.values()))[0], None))
        if name not in names:
            read.faults.append(Fault(place, f'must be a part of the sheet "Parts", got "{name}"'))
            continue
        at = names.index(name)
        table, path, process = parts[at], f"part[{at}]", row.get("process", ("", None))[1]
        if process is not None:
            listed = table.setdefault("process", [])
            path = f"{path}.process[{len(listed)}]"
            table = {"name": process}
            listed.append(table)
        if "cost" in table:
            read.faults.append(Fault(place, f"{name} has a cost already: name the process of each row"))
        read.cells.setdefault(path, place)
        for column, (cell, value) in row.items():
            if column in ("part", "process"):
                continue
            to = column if column in OF_PROCESS else f"cost.{column}"
            if value is not None or f"{path}.{to}" not in read.cells:
                read.cells[f"{path}.{to}"] = cell
            if value is not None:
                _put(table, to, value, cell, read)


# From tables to sheets.


def write_sheets(tables: Mapping[str, Any]) -> bytes:
    """A workbook with the tables of a stack, with notes and drop-down lists: `read_sheets` gives them back."""
    rest = deepcopy(dict(tables))
    frames = {title: [] for title in ("Requirements", "Parts", COSTS)}  # type: dict[str, list[dict[str, Any]]]
    stated = rest.get("requirement")
    if not (isinstance(stated, list) and len(stated) == 1):  # that is a list all the same: a text on the first sheet
        requirements = rest.pop("requirement", [])
        frames["Requirements"] = requirements if isinstance(requirements, list) else [requirements]
        limits = rest.get("limits", {})
        for row in frames["Requirements"]:
            prefix = "" if isinstance(requirements, dict) else f"{row.get('name')}."
            for name in [name for name in limits if name.startswith(prefix) and "." not in name.removeprefix(prefix)]:
                if prefix or not isinstance(limits[name], dict):
                    row[f"{LIMITS}{name.removeprefix(prefix)}"] = limits.pop(name)
        if not limits:
            rest.pop("limits", None)
    for part in rest.pop("part", []):
        row = {key: value for key, value in part.items() if key not in ("cost", "process")}
        frames["Parts"].append(row)
        processes = part.get("process", [{"cost": part["cost"]}] if isinstance(part.get("cost"), dict) else [])
        for process in processes:
            cost = process.get("cost", {})
            known = {key: value for key, value in process.items() if key not in ("name", "cost")}
            named = {"part": part["name"], "process": process.get("name")}
            if not isinstance(cost, dict) or set(known) - set(OF_PROCESS) or set(cost) & set(OF_PROCESS):
                row |= {key: part[key] for key in ("cost", "process") if key in part}
                frames[COSTS] = [line for line in frames[COSTS] if line["part"] != part["name"]]
                break
            frames[COSTS].append(named | known | cost)
    general = [{"key": key, "value": value} for key, value in _flat(rest)]
    return _book({GENERAL: general} | frames)


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys of TOML and their values."""
    for name, value in table.items():
        key = prefix + (name if re.fullmatch(r"[\w-]+", name, re.ASCII) else json.dumps(name))
        if isinstance(value, dict) and value:
            yield from _flat(value, f"{key}.")
        else:
            yield key, value


def _inline(value: Any) -> str:
    """A value as TOML has it in a line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {_inline(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return json.dumps(value)


def _book(sheets: Mapping[str, Sequence[Mapping[str, Any]]]) -> bytes:
    from openpyxl import Workbook
    from openpyxl.comments import Comment
    from openpyxl.worksheet.datavalidation import DataValidation

    book = Workbook()
    book.remove(book.worksheets[0])
    parts = max(LINES, len(sheets["Parts"]) + 1)
    choices = {
        "method": f'"{",".join(METHODS)}"',
        "distribution": f'"{",".join(DISTRIBUTIONS.sound())}"',
        "model": f'"{",".join(CURVES)}"',
        "part": f"Parts!$A$2:$A${parts}",
    }
    for title, rows in sheets.items():
        usual = NOTES[title]
        columns = [*usual, *dict.fromkeys(key for row in rows for key in row if key not in usual)]
        sheet = book.create_sheet(title)
        cells = [[row.get(column) for column in columns] for row in rows]
        fill(sheet, columns, [[_inline(v) if isinstance(v, list | dict) else v for v in line] for line in cells])
        for at, column in enumerate(columns, start=1):
            if column in usual:
                sheet.cell(1, at).comment = Comment(usual[column], "tolevo", height=80, width=300)
            if column in choices and title != GENERAL:
                allowed = DataValidation(type="list", formula1=choices[column], allow_blank=True)
                allowed.add(f"{sheet.cell(2, at).coordinate}:{sheet.cell(parts, at).coordinate}")
                sheet.add_data_validation(allowed)
    return saved(book)


# The result, on sheets that calculate without tolevo.


def with_result(content: bytes, problem: Stack, design: np.ndarray, allocation: pd.DataFrame | None = None) -> bytes:
    """The workbook with the sheets `ALLOCATION` and `ANALYSIS` of a full design (all variables,).

    A part's tolerance on the first is a number that may be changed; worst case and root sum of
    squares of each requirement on the second follow from it by formulas, with the sensitivities at
    the mid-limits as numbers. `allocation` are the rows of `allocation.csv` of the design, if it has some.
    """
    from openpyxl import load_workbook

    records: list[Any] = [] if allocation is None else allocation.to_dict("records")
    book = load_workbook(io.BytesIO(content))
    for title in (ALLOCATION, ANALYSIS):
        if title in book.sheetnames:
            book.remove(book[title])
    _allocation_sheet(book.create_sheet(ALLOCATION), problem, design, {str(row["variable"]): row for row in records})
    _analysis_sheet(book.create_sheet(ANALYSIS), problem, design)
    return saved(book)


OF_PARTS = ("part", "unit", "nominal", "mid", "tolerance", "before rounding", "on the drawing", "process", "spread")
TOLERANCE, SPREAD = "E", "I"
"""Letters of those columns."""
COEFFICIENTS = ("sensitivity", "sum of |sensitivities|", "variance", "mean shift")
"""Columns of each requirement, per unit of the part's tolerance or spread."""


def _allocation_sheet(sheet: Any, problem: Stack, design: np.ndarray, rows: Mapping[str, Mapping[str, Any]]) -> None:
    """A row per part: tolerance, the spread that counts, and what it adds to each requirement per unit of spread."""
    spread, t = spread_of(problem.parts_as_made(design[None]))[0], problem.tolerances(design[None])[0]
    columns = list(OF_PARTS)
    for measured in problem.measured:
        columns += [f"{measured.label}: {what}" for what in COEFFICIENTS]
    lines = []
    for at, part in enumerate(problem.definition.parts):
        row = rows.get(f"{part.name}_t", {})
        ratio = float(spread[at] / t[at]) if t[at] > 0.0 else 1.0
        followed = Live(f"={TOLERANCE}{at + 2}" + ("" if ratio == 1.0 else f"*{ratio!r}"))
        line: list[Any] = [part.name, part.unit, part.nominal, part.mid, float(t[at])]
        line += [row.get("unrounded"), row.get("notation"), row.get("process") or None, followed]
        for measured in problem.measured:
            linear = measured.linear
            line += [float(linear.slope[at]), float(linear.worst[at]), float(linear.covariance[at, at])]
            line += [float(linear.mean[at])]
        lines.append(line)
    fill(sheet, columns, lines)


ANALYSED = (
    *("requirement", "unit", "at the mid-limits", "lower", "upper", "worst case", "worst case least"),
    *("worst case greatest", "mean", "rss", "rss least", "rss greatest", "worst case kept", "rss kept"),
    *("tolevo: worst case", "tolevo: rss", "statement"),
)
LINEAR = "by sensitivities at the mid-limits"


def _analysis_sheet(sheet: Any, problem: Stack, design: np.ndarray) -> None:
    """A row per requirement: worst case and root sum of squares as formulas of the sheet of the allocation."""
    from openpyxl.utils import get_column_letter

    outputs, made = problem.outputs_of(design[None]), problem.parts_as_made(design[None])
    last = len(problem.definition.parts) + 1

    def column(letter: str) -> str:
        return f"{ALLOCATION}!${letter}$2:${letter}${last}"

    lines = []
    for at, measured in enumerate(problem.measured):
        own, linear, row = measured.mechanism, measured.linear, at + 2
        first = len(OF_PARTS) + len(COEFFICIENTS) * at
        worst, variance, mean = (get_column_letter(first + place) for place in (2, 3, 4))
        correlated = "".join(
            f"+2*{float(linear.covariance[i, k])!r}*{ALLOCATION}!{SPREAD}{i + 2}*{ALLOCATION}!{SPREAD}{k + 2}"
            for i, k in zip(*np.nonzero(np.triu(linear.covariance, 1)), strict=True)
        )
        squares = f"SUMPRODUCT({column(variance)},{column(SPREAD)},{column(SPREAD)})"
        ends = [float(end) if np.isfinite(end) else None for end in (own.lower, own.upper)]
        tests = [
            [
                f"{cell}{row}{test}{row}"
                for cell, test, end in zip(cells, (">=D", "<=E"), ends, strict=True)
                if end is not None
            ]
            for cells in ("GH", "KL")
        ]
        formulas = [
            f"=SUMPRODUCT({column(worst)},{column(TOLERANCE)})",
            f"=C{row}-F{row}",
            f"=C{row}+F{row}",
            f"=C{row}+{float((mean_of(made) @ linear.slope)[0])!r}+SUMPRODUCT({column(mean)},{column(SPREAD)})",
            f"=3*SQRT({squares}{correlated})",
            f"=I{row}-J{row}",
            f"=I{row}+J{row}",
        ]
        lines.append(
            [measured.label, measured.requirement.unit, float(own.centre), *ends, *map(Live, formulas)]
            + [Live(f"=AND({','.join(both)})") if both else None for both in tests]
            + [float(outputs[measured.name(kind)][0]) for kind in ("worst_case", "rss")]
            + [f"{LINEAR}; tolevo takes the formula for the worst case" if own.formula else f"linear: {LINEAR}"]
        )
    fill(sheet, list(ANALYSED), lines)
