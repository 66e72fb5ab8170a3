"""`measured` tables of parts, variables and machines, filled in from their files."""

from __future__ import annotations

import copy
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .. import tables
from ..errors import Fault, InputError, nearest, raise_all, refuse
from ..units import to_unit
from .cost_files import fill_costs, tables_in, unit_of
from .cost_rows import Filled, Raw, number_in, options_in

SUFFIXES = (".dfq", ".dfd")
LISTED = 40
"""Characteristics of a file that a fault lists."""
REVISED = {"nominal": "nominal sizes", "made_to": "limits", "lower": "limits", "upper": "limits", "unit": "units"}
"""What files of one characteristic must have in common."""


def with_files(table: Raw, folder: Path, faults: list[Fault]) -> Filled:
    """The tables of a run with the contents of the files that they name, relative to `folder`:
    costs and measured parts. Faults are added to `faults`.
    """
    filled = Filled(copy.deepcopy(table))
    fill_measured(filled, folder, faults)
    fill_costs(filled, folder, faults)
    return filled


def fill_measured(filled: Filled, folder: Path, faults: list[Fault]) -> None:
    """Put the values of every file of measured parts in its place; faults are added to `faults`.

    Lots, nominal and half the distance of the limits (`made_to`) of a Q-DAS file are taken over
    where the configuration does not state them, and the limit where only one is none of nature.
    """
    for owner_place, owner, part in _owners(filled.table):
        measured = owner.get("measured")
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
            sample = together([values for values, _ in read], [name for _, name in read], place, faults)
            if len(faults) > before:
                measured["values"] = None  # no further faults are reported for them
                continue
            owner["measured"] = sample | measured


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


def _read(path: Path, wanted: Any, options: tables.ReadOptions, place: str, faults: list[Fault]) -> Raw | None:
    try:
        return opened_parts(path, options).characteristic(wanted)
    except InputError as error:
        faults += [Fault(place, f"{fault.place} {fault.message}") for fault in error.faults]
        return None


def _nine_digit_text(value: Any) -> str:
    """A number by nine digits: limits and deviations of one drawing differ by rounding."""
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def together(characteristics: list[Raw], names: Sequence[str], place: str, faults: list[Fault]) -> Raw:
    """The values of several files of one characteristic, in their order, a file without
    lots being one lot. Files of different revisions of the drawing, or units, are a fault.
    """
    if len(characteristics) < 2:
        return characteristics[0] if characteristics else {}
    for key, what in REVISED.items():
        stated = {
            _nine_digit_text(characteristic[key]): name
            for characteristic, name in zip(characteristics, names, strict=True)
            if key in characteristic
        }
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
    return whole


@dataclass(frozen=True)
class MeasuredFile:
    """A file of measured parts, opened once: the labels of its characteristics, the label by every
    name that a characteristic may be requested by, and the values by label.
    """

    place: str
    labels: tuple[str, ...]
    names: Mapping[str, str]
    values: Callable[[str], Raw]

    def characteristic(self, wanted: Any) -> Raw:
        """The characteristic that is wanted, or the only one; raises InputError without it."""
        return self.values(_chosen(self.place, wanted, dict(self.names), list(self.labels)))


def opened_parts(path: Path, options: tables.ReadOptions) -> MeasuredFile:
    """A file of measured parts. Raises InputError where it is not there, or cannot be read."""
    if path.suffix.lower() in SUFFIXES:
        return _of_aqdef(path, options)
    table = tables.opened_whole(path, path.name, options)
    names = {name: name for name in table.columns.names}
    names |= {table.headers.get(name, name): name for name in table.columns.names}
    labels = table.columns.names
    if len(labels) > 1:
        labels = [name for name in labels if name in table.units or _measures(table.frame[name])]

    def values(name: str) -> Raw:
        numbers, unit = _numbers(table, name, path.name), table.units.get(name, "")
        notes = [note for note in table.lines(path.name)[2:] if "hold no number" not in note]
        if missing := len(table.columns) - len(numbers):
            notes.append(f"{path.name}: {missing} of {len(table.columns)} values of {name} are missing, and left out")
        return {"values": numbers, "notes": notes} | ({"unit": unit} if unit else {})

    return MeasuredFile(path.name, tuple(labels), names, values)


def _measures(column: pd.Series[Any]) -> bool:
    """Whether a column holds a number, and does not just count its rows (1, 2, 3, ...)."""
    values = pd.to_numeric(column, errors="coerce").to_numpy(dtype=float)
    return bool(np.any(np.isfinite(values)) and not np.all(np.diff(values) == 1.0))


def _numbers(table: tables.Table, name: str, place: str) -> list[float]:
    """The numbers of a column; cells that are empty, or mark a missing value, are left out.

    Raises InputError with a fault for every cell that holds anything else.
    """
    numbers, bad = [], {}
    for line, cell, value in zip(table.columns.lines, table.cells[name], table.frame[name], strict=True):
        number = number_in(value) if isinstance(value, str) else math.nan if pd.isna(value) else float(value)
        if math.isfinite(number):
            numbers.append(number)
        elif not (pd.isna(cell) or tables.is_missing(str(cell).strip())):
            bad[line] = f'must be a finite number, or empty where there is none, got "{cell}"'
    raise_all(tables.cell_faults(place, table.headers.get(name, name), bad))
    return numbers


def _of_aqdef(path: Path, options: tables.ReadOptions) -> MeasuredFile:
    read = tables.read_aqdef(path, options.encoding, times=False)
    known = {name: c for name, c in zip(tables.names_of_characteristics(read), read, strict=True) if not c.attributive}
    keys = [(key, name) for name, c in known.items() for key in {c.number, c.name, c.label, name} if key]
    count = Counter(key for key, _ in keys)
    names = {key: name for key, name in keys if count[key] == 1 or key == name}
    return MeasuredFile(path.name, tuple(known), names, lambda name: _values(known[name], path.name))


def _values(characteristic: tables.Characteristic, place: str) -> Raw:
    """What a Q-DAS file says of a characteristic."""
    cells = zip(characteristic.values, characteristic.batches, strict=True)
    rows = [(value, lot) for value, lot in cells if value is not None]
    values: Raw = {"values": [float(value) for value, _ in rows], "characteristic": characteristic.label}
    if missing := len(characteristic.values) - len(rows):
        what = f"values of {characteristic.label} are missing or not valid (K0002), and left out"
        values["notes"] = [f"{place}: {missing} of {len(characteristic.values)} {what}"]
    if any(lot for _, lot in rows):
        values["lots"] = [lot for _, lot in rows]
    if characteristic.unit:
        values["unit"] = characteristic.unit
    if characteristic.nominal is not None:
        values["nominal"] = characteristic.nominal
    ends = {"lower": characteristic.lower, "upper": characteristic.upper}
    natural = [side for side, key in (("lower", "K2120"), ("upper", "K2121")) if characteristic.keys.get(key) == "2"]
    limits = {side: end for side, end in ends.items() if end is not None and side not in natural}
    if characteristic.lower is not None and characteristic.upper is not None and limits:
        values["made_to"] = 0.5 * (characteristic.upper - characteristic.lower)
    return values | (limits if len(limits) == 1 else {})


def _chosen(place: str, wanted: Any, names: dict[str, str], labels: list[str]) -> str:
    """The characteristic that is wanted, or the only one there is."""
    if wanted is None and len(labels) == 1:
        return labels[0]
    if not labels:
        raise refuse(place, f"has no column of measured values; it has {_listed(list(dict.fromkeys(names.values())))}")
    if wanted is None:
        text = f"has {len(labels)} characteristics: state which one is meant, characteristic = ..."
        raise refuse(place, f"{text}; it has {_listed(labels)}")
    if str(wanted) not in names:
        text = f'has no characteristic "{wanted}"{nearest(str(wanted), names)}'
        raise refuse(place, f"{text}; it has {_listed(labels)}")
    return names[str(wanted)]


def _listed(labels: list[str]) -> str:
    return ", ".join(labels[:LISTED]) + (f", ... ({len(labels)} in all)" if len(labels) > LISTED else "")
