"""`tolevo evaluate`: the problem at given designs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from ..errors import Fault
from ..files import write_text
from ..problems.tolerance_problem import Array, ToleranceProblem
from ..tables import Table, column_faults, numbers, read_table, refuse_all


def evaluate(problem: ToleranceProblem, path: Path, out: Path) -> pd.DataFrame:
    """Every variable, output and limit margin at the designs of a CSV, one row each, into `out`.

    A column may be left out where the problem fixes that variable. Designs need not lie in the
    search ranges. Raises InputError with every fault of the table.
    """
    frame = problem.frame(read_designs(problem, path))
    write_text(out, frame.to_csv(index=False))
    return frame


def read_designs(problem: ToleranceProblem, path: Path) -> Array:
    """Full designs (n, all variables) of a CSV."""
    table = read_table(path)
    faults = column_faults(table, [v.name for v in problem.free], list(problem.fixed))
    names = [name for name in problem.names if name in table.header]
    values, wrong = numbers(table, names)
    faults += wrong
    if not faults:
        faults += _invalid(problem, table, names, values)
    refuse_all(faults)
    designs = np.empty((len(values), len(problem.names)))
    for at, name in enumerate(problem.names):
        given = name in table.header
        designs[:, at] = values[:, names.index(name)] if given else problem.fixed[name]
    return designs


def _invalid(
    problem: ToleranceProblem, table: Table, names: list[str], values: Array
) -> list[Fault]:
    """A fault for every value that has no physical meaning."""
    faults = []
    for variable in problem.variables:
        if variable.name not in names:
            continue
        column = values[:, names.index(variable.name)]
        wrong = (column < variable.valid_low) | (column > variable.valid_high)
        faults += [
            Fault(table.where(int(row), variable.name), f"must lie in [{variable.valid_low:g}, "
                  f"{variable.valid_high:g}], got {column[row]:g}")
            for row in np.flatnonzero(wrong)
        ]  # fmt: skip
        if variable.integer:
            faults += [
                Fault(table.where(int(row), variable.name), f"must be whole, got {column[row]:g}")
                for row in np.flatnonzero(column != np.rint(column))
            ]
    return faults
