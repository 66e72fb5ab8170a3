"""`tolevo evaluate`: a problem at given designs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import pandas as pd

from .. import tables
from ..blocks import ArrayRows, Computed
from ..errors import Fault, nearest, raise_all
from ..problems.settings import unit_slip
from ..problems.tolerance_problem import ToleranceProblem
from ..section import Array, Variable
from ..units import unit_hint

WITHIN = 1e-9
"""Fraction of a range by which a design may leave it: the last digits of a table."""
ALLOCATION = ("choice", "point", "variable", "unit", "rounded")
"""Columns of the table of the chosen points of a run, a row for each variable."""
GRAIN = 64
"""Designs that are evaluated at once."""
REPORTED, SEARCH = "reported", "search"
QUALITIES = (REPORTED, SEARCH)
"""Accuracy: as points of a result are reported, or as a search evaluates them."""


@dataclass(frozen=True)
class Evaluation:
    """Every variable, output and limit margin of full designs, a grain of them at a time."""

    problem: ToleranceProblem
    searching: bool = False

    def __call__(self, designs: Array, number: int) -> pd.DataFrame:
        return self.problem.frame(designs, searching=self.searching)


def evaluation(problem: ToleranceProblem, designs: Array, configuration: str = "", quality: str = REPORTED) -> Computed:
    """The table of a problem at full designs (n, all variables), to be computed in blocks."""
    compute = Evaluation(problem, quality == SEARCH)
    return Computed("evaluate", compute, configuration, ArrayRows(designs), GRAIN, quality)


def designs_in(
    problem: ToleranceProblem,
    table: tables.Table,
    place: str,
    understood: tables.Tell = tables.discard_lines,
    searched: bool = False,
) -> Array:
    """Full designs (n, all variables) in a table that faults call `place`.

    A column may be left out where the problem fixes that variable; where it is given, it counts.
    `[columns]` of the configuration says what columns of the file are. Of an `allocation.csv`, whose rows are
    variables, the designs are the rounded ones.
    A tolerance of 0 is evaluated as a limit: its cost may be infinite (`inf`).
    A design outside of the ranges that are searched is a fault where it is to be `searched`, else
    it is reported. Raises InputError with every fault of the table.
    """
    table = _designs_of_allocation(problem, table, place)
    names = [variable.name for variable in problem.variables]
    needed = [name for name in names if name not in problem.fixed]
    labelled = [variable.name for variable in problem.variables if variable.labels]
    known = {variable.name: variable.unit for variable in problem.variables}
    fitted = tables.fit_columns(table, place, known, problem.settings.columns)
    cells, unused = tables.drop_unused(fitted.cells, names)
    frame, faults = tables.parse_columns(cells, place, needed, names, labelled)
    faults += fitted.faults
    for variable in problem.variables:
        if variable.name in frame:
            if variable.labels:
                frame[variable.name], bad = _choice_numbers(variable, frame[variable.name])
            else:
                bad = _value_faults(variable, frame[variable.name])
            faults += tables.cell_faults(place, variable.name, bad)
    raise_all(faults)
    understood([*_slips(problem, frame), *table.lines(place), *fitted.notes, *unused])
    frame = frame.assign(**{n: v for n, v in problem.fixed.items() if n not in frame})
    designs = frame[names].to_numpy(dtype=float)
    for name, bad_rows in problem.misplaced(designs).items():
        bad = {frame.index[row]: reason for row, reason in bad_rows.items()}
        faults += tables.cell_faults(place, name, bad)
    left = _range_violations(problem, designs, frame.index)
    for name, rows in left.items() if searched else ():
        faults += tables.cell_faults(place, name, rows)
    raise_all(faults)
    understood(_range_notes(left))
    return designs


def _designs_of_allocation(problem: ToleranceProblem, table: tables.Table, place: str) -> tables.Table:
    """The table; that of the allocation of a run with a row for each chosen point and a column for each variable."""
    if not set(ALLOCATION) <= set(table.columns.names):
        return table
    cells = table.cells.astype({"point": str, "variable": str})
    units = {variable.name: variable.unit for variable in problem.variables}
    keys = zip(cells.index, cells["point"], cells["variable"], cells["unit"].fillna(""), strict=True)
    seen, faults = set[tuple[str, str]](), list[Fault]()
    for line, point, name, unit in keys:
        if (point, name) in seen:
            faults.append(Fault(f"{place}: row {line}", f"states {name} of point {point} again: keep one of them"))
        elif name in units and str(unit) != units[name]:
            text = f'states {name} in "{unit}", but this configuration has it in "{units[name]}"'
            faults.append(Fault(f"{place}: row {line}", text))
        seen.add((point, name))
    raise_all(faults)
    points, columns = (list(dict.fromkeys(cells[name])) for name in ("point", "variable"))
    wide = cells.set_index(["point", "variable"])["rounded"].unstack().loc[points, columns]  # noqa: PD010
    made, _ = tables.table_of(wide, place)
    note = f"rounded values of the chosen point{'s' * (len(points) > 1)} {', '.join(points)}"
    numeric = tuple(v.name for v in problem.variables if v.name in columns and not v.labels)
    return replace(made, dialect=table.dialect, notes=(note,), numeric=numeric)


def _range_violations(problem: ToleranceProblem, designs: Array, index: pd.Index[Any]) -> dict[str, dict[object, str]]:
    """Where full designs (n, all variables) leave what is searched: reasons by row, by variable."""
    reasons: dict[str, dict[object, str]] = {}
    ranges = {v.name: (low, high) for v, low, high in zip(problem.free, problem.xl, problem.xu, strict=True)}
    ranges |= {name: (value, value) for name, value in problem.fixed.items()}
    for variable in problem.variables:
        low, high = ranges[variable.name]
        unit, room = f" {variable.unit}".rstrip(), WITHIN * max(high - low, abs(high), abs(low))
        for at, value in zip(index, problem.column(designs, variable.name).tolist(), strict=True):
            if low - room <= value <= high + room:
                continue
            if low == high:
                why = f"is fixed at {low:g}{unit}"
            else:
                why = f"must be at least {low:g}{unit}" if value < low else f"must be at most {high:g}{unit}"
            reasons.setdefault(variable.name, {})[at] = f"{why}, got {value:g}"
    return reasons


def _range_notes(reasons: dict[str, dict[object, str]]) -> list[str]:
    """Which designs leave the ranges of the problem, a line per variable."""
    lines = []
    for name, rows in reasons.items():
        row, why = next(iter(rows.items()))
        more = {1: "", 2: "; another row as well"}.get(len(rows), f"; {len(rows) - 1} more rows as well")
        lines.append(f"row {row} leaves what the problem searches: {name} {why}{more}")
    return lines


def _slips(problem: ToleranceProblem, frame: pd.DataFrame) -> list[str]:
    """Tolerances that lie all but 0 far from the range that is searched, as in another unit."""
    questions = []
    for variable in problem.free:
        if not variable.tolerance or variable.labels or variable.name not in frame:
            continue
        values = frame[variable.name].to_numpy(dtype=float)
        if len(values := values[values != 0.0]):
            texts = [unit_slip(end, variable.unit, variable.low, variable.high) for end in (values.min(), values.max())]
            if all(texts):
                questions.append(f"is column {variable.name} in another unit? {texts[0]}")
    return questions


def _choice_numbers(variable: Variable, column: pd.Series[str]) -> tuple[pd.Series[float], dict[object, str]]:
    """The numbers that the names of a choice stand for, and what is wrong with them, by row."""
    numbers = column.map({label: float(at) for at, label in enumerate(variable.labels)})
    valid = ", ".join(variable.labels)
    bad: dict[object, str] = {
        at: f'must be one of {valid}, got "{name}"{nearest(str(name), variable.labels)}'
        for at, name in column[numbers.isna()].items()
        if name
    }
    return numbers, bad


def _value_faults(variable: Variable, column: pd.Series[float]) -> dict[object, str]:
    """What is wrong with the values of a variable, by row."""
    low, high, unit = variable.valid_low, variable.valid_high, f" {variable.unit}".rstrip()
    bad: dict[object, str] = {}
    for at, value in column.items():
        hint = unit_hint(value, variable.unit, variable.low, variable.high)
        if value < low:
            bad[at] = f"must be at least {low:g}{unit}, got {value:g}{hint}"
        elif value > high:
            bad[at] = f"must be at most {high:g}{unit}, got {value:g}{hint}"
        elif variable.integer and value == value and value != round(value):
            bad[at] = f"must be a whole number, got {value:g}"
    return bad
