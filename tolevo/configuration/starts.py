"""`start`: the designs that a search begins from: tables, fronts of other runs, or columns in the file itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .. import tables
from ..algorithms.settings import Budget
from ..errors import Fault, InputError, raise_all
from ..problems.tolerance_problem import ToleranceProblem, designs_frame
from ..section import Array, Section
from .configuration import START

FRONT = "front.csv"
"""The table of a directory that `tolevo run` wrote."""
Opened = list[tuple[str, tables.Table]]


@dataclass(frozen=True, eq=False)
class Start:
    """Search vectors (n, free variables) to begin from, each design once, and notes for the user."""

    x: Array
    notes: tuple[str, ...] = ()

    def table(self, problem: ToleranceProblem) -> dict[str, list[Any]]:
        """The designs by column: what the resolved configuration holds in the place of files."""
        frame = designs_frame(problem, problem.complete(self.x))
        return {name: frame[name].tolist() for name in (variable.name for variable in problem.free)}


def open_start(top: Section, folder: Path) -> Opened | None:
    """The tables that `start` names, with what faults call them; None where there is none.

    It is a file, a directory of a run, several of them, or a table of columns.
    """
    import pandas as pd

    stated = top.take(START)
    if stated is None:
        return None
    found: Opened = []
    if isinstance(stated, Mapping):
        lengths = {len(column) if isinstance(column, list) else None for column in stated.values()}
        if len(lengths) != 1 or None in lengths:
            top.fault(START, "must have columns of one length, a list of values for each variable")
            return None
        stated = pd.DataFrame(dict(stated))
    if isinstance(stated, pd.DataFrame):
        frame = stated
        _open(top, START, lambda: tables.table_of(frame, START), found)
        return found
    if isinstance(stated, np.ndarray):
        text = (
            "is an array, whose columns have no names: give pandas.DataFrame(array, columns=[...]) with the variables"
        )
        top.fault(START, text)
        return None
    names = stated if isinstance(stated, list) else [stated]
    if not names or not all(isinstance(name, str) and name for name in names):
        top.fault(START, "must name a table of designs, the directory of a run, or a list of these")
        return None
    for name in names:
        path = folder / name
        if path.is_dir() and not (path / FRONT).is_file():
            top.fault(START, f"{name} holds no {FRONT}: name the directory of a run, or a table of designs")
            continue
        path = path / FRONT if path.is_dir() else path
        _open(top, name, lambda path=path, name=name: tables.open_table(path, name, tables.NO_OPTIONS), found)
    return found


def _open(top: Section, name: str, read: Any, found: Opened) -> None:
    table, faults = read()
    for fault in faults:
        top.fault(START, f"{fault.place} {fault.message}".removeprefix(f"{START} "))
    if table is not None and not faults:
        found.append((name, table))


def read_start(problem: ToleranceProblem, opened: Opened | None, budget: Budget) -> Start:
    """The designs of the tables together. Raises InputError with every fault, its table and row."""
    free = [problem.names.index(variable.name) for variable in problem.free]
    if not opened or not free:
        return Start(np.empty((0, len(free))))
    from ..commands.evaluate import designs_in  # with what computes tables, which few configurations need

    designs, notes, faults = [], list[str](), list[Fault]()
    for name, table in opened:
        place = name if name == START else f"{START}: {name}"
        try:
            tell = notes.extend if name != START else tables.discard_lines
            designs.append(designs_in(problem, table, place, tell, searched=True)[:, free])
        except InputError as error:
            faults += error.faults
    raise_all(faults)
    whole = np.clip(np.concatenate(designs), problem.xl, problem.xu)
    whole = np.where([variable.integer for variable in problem.free], np.rint(whole), whole)
    distinct = np.sort(np.unique(whole, axis=0, return_index=True)[1])
    if not len(whole):
        raise_all([Fault(START, "holds no design: name a table with at least one row, or leave it out")])
    if budget.evaluations is not None and budget.evaluations < len(distinct):
        text = f"must be at least {len(distinct)}, the designs of start, which are evaluated first"
        raise_all([Fault("algorithm.evaluations", f"{text}; got {budget.evaluations}")])
    files = [name for name, _ in opened if name != START]
    count, again = len(distinct), len(whole) - len(distinct)
    lines = [f"the search starts from {count} design{'s' * (count > 1)}" + f" of {', '.join(files)}" * bool(files)]
    if again:
        lines.append(f"designs of start that equal another one are left out: {again}")
    return Start(whole[distinct], (*lines, *notes))
