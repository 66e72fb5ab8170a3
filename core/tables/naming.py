"""Columns of a table with the names and in the units of the model that reads it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ..errors import Fault, nearest
from ..units import converted, fits, split_unit
from .marks import is_date
from .moments import seconds
from .record import Table

AQDEF = "aqdef"
OF_AQDEF = {"time": "time_s", "batch": "lot"}
"""What the times and batches of a Q-DAS file are."""
Tell = Callable[[Iterable[str]], None]
"""Takes the notes on how a table was read, line by line."""


def silent(lines: Iterable[str]) -> None:
    """Discard the lines."""


@dataclass(frozen=True, slots=True)
class ColumnUse:
    """What a column of a file is: the name that it has where it is read ("": it is left out), its
    unit where the file does not state it, and the sign that it counts by.
    """

    target: str
    unit: str = ""
    sense: int = 1


@dataclass(frozen=True, slots=True)
class Fitted:
    """Cells by the names of the model that reads them, notes on that, and faults."""

    cells: pd.DataFrame
    notes: tuple[str, ...] = ()
    faults: tuple[Fault, ...] = ()


def fitted(table: Table, place: str, known: Mapping[str, str], uses: Mapping[str, ColumnUse] | None = None) -> Fitted:
    """The table with its columns named and in units as `known` (unit by name) has them.

    `uses` states what columns of the file are; a column whose name and unit are those of a known
    name, "torque [N mm]" of "torque_Nm", is matched without it.
    """
    spelt = {spelling: name for name, spelling in table.headers.items()}
    spelt |= {str(name): str(name) for name in table.cells}
    notes: list[str] = []
    faults: list[Fault] = []
    names: dict[str, str] = {}
    cells = dict(table.cells.items())
    for key, use in (uses or {}).items():
        name = spelt.get(key)
        if name is None:
            if use.target and use.target not in spelt:
                faults.append(Fault(f'columns."{key}"', f"{place} has no such column{nearest(key, spelt)}"))
        else:
            names[name] = use.target
            cells[name], wrong = _used(cells[name], table.units.get(name, ""), use, known)
            faults += [Fault(f'columns."{key}"', text) for text in wrong]
    free = {name: unit for name, unit in known.items() if name not in names.values()}
    for wanted, unit in free.items():
        if (name := spelt.get(wanted)) is not None and name not in names:
            names[name] = wanted
            if wrong_unit := _contradiction(table.units.get(name, ""), wanted, unit):
                faults.append(Fault(f"{place}: column {table.headers.get(name, name)}", wrong_unit))
    for wanted, unit in free.items():
        name = _alike(table, wanted, unit, names)
        if wanted not in names.values() and name is not None:
            names[name] = wanted
            cells[name] = _in_unit(cells[name], table.units[name], unit, 1)
            notes.append(f'"{table.headers[name]}" is read as {wanted}')
    names |= _of_aqdef(table, names, free)
    for name, target in names.items():
        if known.get(target) == "s":
            cells[name], interpretations, wrong = _clock(cells[name])
            place_of = f"{place}: column {table.headers.get(name, name)}"
            faults += [Fault(place_of, text) for text in wrong]
            notes += [
                f'"{table.headers.get(name, name)}" is read as {target}: {interpretation}'
                for interpretation in interpretations
            ]
    kept = {names.get(str(n), str(n)): c for n, c in cells.items() if names.get(str(n), "-")}
    taken = [target for target in names.values() if target]
    for target in sorted({name for name in taken if taken.count(name) > 1}):
        both = ", ".join(f'"{name}"' for name, used_as in names.items() if used_as == target)
        faults.append(Fault("columns", f"{both} are all mapped to {target}; only one column can be"))
    return Fitted(pd.DataFrame(kept, index=table.cells.index), tuple(notes), tuple(faults))


def _of_aqdef(table: Table, names: Mapping[str, str], free: Mapping[str, str]) -> dict[str, str]:
    """Times and batches of a Q-DAS file that no `[columns]` entry maps."""
    if table.dialect.kind != AQDEF:
        return {}
    return {
        name: target
        for name, target in OF_AQDEF.items()
        if name in table.cells and name not in names and target in free and target not in names.values()
    }


def _clock(cells: pd.Series[Any]) -> tuple[pd.Series[Any], list[str], list[str]]:
    """Dates and times of day as seconds since the earliest, a note, and what is wrong; numbers stay
    as they are.
    """
    texts = ["" if cell is None or cell != cell else str(cell) for cell in cells]
    if not any(map(is_date, texts)):
        return cells, [], []
    try:
        elapsed, start = seconds(texts)
    except ValueError as error:  # reported once, not for every row
        return pd.Series(np.arange(len(cells), dtype=float), index=cells.index), [], [str(error)]
    since = f"{start:%Y-%m-%d %H:%M:%S%z}" if start.year > 1900 else f"{start:%H:%M:%S%z}"
    return pd.Series(elapsed, index=cells.index), [f"seconds since {since}"], []


def without_unused(cells: pd.DataFrame, known: Sequence[str]) -> tuple[pd.DataFrame, list[str]]:
    """The columns that are known, or whose names may be slips of one that is missing; a note."""
    free = [name for name in known if name not in cells]
    unused = [str(n) for n in cells if n not in known and not nearest(str(n), free)]
    if not unused:
        return cells, []
    listed = ", ".join(unused[:10]) + (", ..." if len(unused) > 10 else "")
    return cells.drop(columns=unused), [f"not used: {listed}"]


def _used(
    cells: pd.Series[Any], stated: str, use: ColumnUse, known: Mapping[str, str]
) -> tuple[pd.Series[Any], list[str]]:
    """The cells of a column that is mapped, in the unit of its target."""
    unit = known.get(use.target, "")
    if use.unit and stated and not _is_same_unit(use.unit, stated):
        return cells, [f'the file says "{stated}", the configuration "{use.unit}"']
    source_unit = use.unit or stated
    if source_unit and unit and not fits(source_unit, unit):
        return cells, [f'"{source_unit}" cannot be stated in {unit}, the unit of {use.target}']
    return _in_unit(cells, source_unit or unit, unit, use.sense), []


def _contradiction(stated: str, name: str, unit: str) -> str:
    """What is wrong where the file states another unit than the name of the column."""
    if not stated or not unit or _is_same_unit(stated, unit):
        return ""
    return f'is stated in "{stated}", but {name} is in "{unit}"; rename it or map it in [columns]'


def _is_same_unit(unit: str, stated: str) -> bool:
    if unit == stated:
        return True
    if not fits(unit, stated):
        return False
    probes = np.array([0.0, 1.0])
    return bool(np.allclose(converted(probes, unit, stated), probes, rtol=1e-12, atol=0.0))


def _alike(table: Table, wanted: str, unit: str, names: Mapping[str, str]) -> str | None:
    """A column whose name is that of `wanted` without its unit, and whose unit fits."""
    stem = split_unit(wanted)[0].casefold()
    for name, stated in table.units.items():
        spelt = name.casefold().replace(" ", "_")
        if name not in names and unit and spelt == stem and fits(stated, unit):
            return name
    return None


def _in_unit(cells: pd.Series[Any], source_unit: str, unit: str, sense: int) -> pd.Series[Any]:
    """Cells of numbers in another unit and sense; cells that are not numbers stay as they are."""
    if sense == 1 and (source_unit == unit or not source_unit or not unit or _is_same_unit(source_unit, unit)):
        return cells
    numbers = pd.to_numeric(cells.astype(object), errors="coerce").to_numpy(dtype=float)
    values = sense * np.asarray(converted(numbers, source_unit, unit) if source_unit and unit else numbers)
    good = np.isfinite(values)
    result = cells.to_numpy(dtype=object).copy()
    result[good] = values[good]
    return pd.Series(result, index=cells.index, dtype=object)
