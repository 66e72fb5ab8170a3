"""`measured` tables of parts, variables and machines, filled in from their files."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import tables
from ..errors import Fault, InputError, nearest, refuse
from .cost_files import fill_costs, tables_in
from .cost_rows import Filled, Raw

SUFFIXES = (".dfq", ".dfd")
OPTIONS = ("encoding", "delimiter", "decimal")
REVISED = {"nominal": "nominal sizes", "made_to": "limits", "lower": "limits", "upper": "limits", "unit": "units"}
"""What files of one characteristic must have in common."""


def with_files(table: Raw, folder: Path, faults: list[Fault]) -> Filled:
    """The tables of a run with the contents of the files that they name, relative to `folder`:
    costs and measured parts. Faults are added to `faults`.
    """
    filled = Filled(copy.deepcopy(table))
    fill_measured(filled.table, folder, faults)
    fill_costs(filled, folder, faults)
    return filled


def fill_measured(table: Raw, folder: Path, faults: list[Fault]) -> None:
    """Put the values of every file of measured parts in its place; faults are added to `faults`.

    Lots, nominal and half the distance of the limits (`made_to`) of a Q-DAS file are taken over
    where the configuration does not state them, and the limit where only one is none of nature.
    """
    for owner_place, owner in _owners(table):
        measured = owner.get("measured")
        if isinstance(measured, dict) and "file" in measured:
            place = f"{owner_place}.measured.file"
            names = measured.pop("file")
            names = [names] if isinstance(names, str) else names
            options = tables.ReadOptions(*(measured.pop(key, None) for key in OPTIONS))
            if not (isinstance(names, list) and names and all(isinstance(name, str) for name in names)):
                faults.append(Fault(place, f"must be the name of a file, or a list of them, got {names}"))
                continue
            if "values" in measured:
                faults.append(Fault(place, "is given in addition to values: keep only one of them"))
                continue
            wanted, before = measured.get("characteristic"), len(faults)
            contents = [_read(folder / name, wanted, options, place, faults) for name in names]
            known = [(values, name) for values, name in zip(contents, names, strict=True) if values is not None]
            filled = together([values for values, _ in known], [name for _, name in known], place, faults)
            if len(faults) > before:
                measured["values"] = None  # no further faults are reported for them
                continue
            owner["measured"] = filled | measured


def _owners(table: Raw) -> Iterator[tuple[str, Raw]]:
    """Every table that may have a table `measured`, with its place: parts, variables, machines."""
    for at, part in tables_in(table, "part"):
        yield f"part[{at}]", part
        for number, machine in tables_in(part, "machine"):
            yield f"part[{at}].machine[{number}]", machine
    variables = table.get("variables")
    for name, variable in (variables if isinstance(variables, dict) else {}).items():
        if not isinstance(variable, dict):
            continue
        yield f"variables.{name}", variable
        for number, machine in tables_in(variable, "machine"):
            yield f"variables.{name}.machine[{number}]", machine


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
    names = {name: name for name in table.numeric}
    names |= {table.headers.get(name, name): name for name in table.numeric}

    def values(name: str) -> Raw:
        column, unit = table.frame[name].dropna(), table.units.get(name, "")
        return {"values": [float(value) for value in column]} | ({"unit": unit} if unit else {})

    return MeasuredFile(path.name, tuple(table.numeric), names, values)


def _of_aqdef(path: Path, options: tables.ReadOptions) -> MeasuredFile:
    known = [measured for measured in tables.read_aqdef(path, options.encoding) if not measured.attributive]
    names = {
        key: measured.label for measured in known for key in (measured.number, measured.name, measured.label) if key
    }
    first = {measured.label: measured for measured in reversed(known)}
    labels = tuple(dict.fromkeys(measured.label for measured in known))
    return MeasuredFile(path.name, labels, names, lambda label: _values(first[label]))


def _values(characteristic: tables.Characteristic) -> Raw:
    """What a Q-DAS file says of a characteristic."""
    cells = zip(characteristic.values, characteristic.batches, strict=True)
    rows = [(value, lot) for value, lot in cells if value is not None]
    values: Raw = {"values": [float(value) for value, _ in rows], "characteristic": characteristic.label}
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
    if wanted is None:
        text = f"has {len(labels)} characteristics: state which one is meant, characteristic = ..."
        raise refuse(place, f"{text}; it has {', '.join(labels)}")
    if str(wanted) not in names:
        text = f'has no characteristic "{wanted}"{nearest(str(wanted), names)}'
        raise refuse(place, f"{text}; it has {', '.join(labels)}")
    return names[str(wanted)]
