"""`tolevo evaluate`: a problem at given designs."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from .. import tables
from ..declarations import Variable
from ..errors import raise_all
from ..problems.tolerance_problem import ToleranceProblem


def evaluate(problem: ToleranceProblem, path: Path, out: Path) -> pd.DataFrame:
    """Every variable, output and limit margin at the designs in `path`, written to `out`.

    A column may be left out where the problem fixes that variable; where it is given, it counts.
    A tolerance of 0 is evaluated as the limit it is: its cost may be infinite (`inf`).
    Raises InputError with every fault of the table; nothing is written then.
    """
    place = path.name
    given = tables.read(path, place)
    names = [variable.name for variable in problem.variables]
    needed = [name for name in names if name not in problem.fixed]
    frame, faults = tables.parsed(given, place, needed, names)
    for variable in problem.variables:
        if variable.name in frame:
            bad = _outside(variable, frame[variable.name])
            faults += tables.cell_faults(place, variable.name, bad)
    raise_all(faults)
    frame = frame.assign(**{n: v for n, v in problem.fixed.items() if n not in frame})
    found = problem.frame(frame[names].to_numpy(dtype=float))
    tables.write(found, out)
    return found


def _outside(variable: Variable, column: pd.Series[float]) -> dict[object, str]:
    """What is wrong with the values of a variable, by row."""
    low, high, unit = variable.valid_low, variable.valid_high, f" {variable.unit}".rstrip()
    bad: dict[object, str] = {}
    for at, value in column.items():
        if value < low:
            bad[at] = f"must be at least {low:g}{unit}, got {value:g}"
        elif value > high:
            bad[at] = f"must be at most {high:g}{unit}, got {value:g}"
        elif variable.integer and value == value and value != round(value):
            bad[at] = f"must be a whole number, got {value:g}"
    return bad
