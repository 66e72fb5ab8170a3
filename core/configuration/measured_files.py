"""`measured` tables of parts, variables and machines: what their files say, put in its place."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import tables
from ..errors import Fault, InputError, nearest
from .cost_files import Raw, tables_in

SUFFIXES = (".dfq", ".dfd")
OPTIONS = ("encoding", "delimiter", "decimal")
REVISED = {"nominal": "nominal sizes", "made_to": "limits", "unit": "units"}
"""What files of one characteristic must have in common."""


def fill_measured(table: Raw, folder: Path, faults: list[Fault]) -> None:
    """Put the values of every file of measured parts in its place; faults are added to `faults`.

    Of a Q-DAS file lots, nominal and half the distance of its limits (`made_to`) come along where
    the configuration does not state them.
    """
    for owner_place, owner in _owners(table):
        own = owner.get("measured")
        if isinstance(own, dict) and "file" in own:
            place = f"{owner_place}.measured.file"
            names = own.pop("file")
            names = [names] if isinstance(names, str) else names
            options = tables.ReadOptions(*(own.pop(key, None) for key in OPTIONS))
            if not _are_names(names):
                text = f"must be the name of a file, or a list of them, got {names}"
                faults.append(Fault(place, text))
                continue
            if "values" in own:
                faults.append(Fault(place, "is given beside values: keep one"))
                continue
            wanted, before = own.get("characteristic"), len(faults)
            found = [_read(folder / name, wanted, options, place, faults) for name in names]
            known = [(one, name) for one, name in zip(found, names, strict=True) if one is not None]
            filled = together([one for one, _ in known], [name for _, name in known], place, faults)
            if len(faults) > before:
                own["values"] = None  # nothing more is said of them
                continue
            owner["measured"] = filled | own


def _owners(table: Raw) -> Iterator[tuple[str, Raw]]:
    """Every table that may have a `measured` one, with its place: parts, variables, machines."""
    for at, part in tables_in(table, "part"):
        yield f"part[{at}]", part
        for number, machine in tables_in(part, "machine"):
            yield f"part[{at}].machine[{number}]", machine
    variables = table.get("variables")
    for name, own in (variables if isinstance(variables, dict) else {}).items():
        if not isinstance(own, dict):
            continue
        yield f"variables.{name}", own
        for number, machine in tables_in(own, "machine"):
            yield f"variables.{name}.machine[{number}]", machine


def _are_names(names: Any) -> bool:
    return isinstance(names, list) and bool(names) and all(isinstance(one, str) for one in names)


def _read(
    path: Path, wanted: Any, options: tables.ReadOptions, place: str, faults: list[Fault]
) -> Raw | None:
    try:
        return measured_in(path, wanted, options)
    except InputError as error:
        faults += [Fault(place, f"{one.place} {one.message}") for one in error.faults]
        return None


def _stated(value: Any) -> str:
    """A number by nine digits: limits and deviations of one drawing differ by rounding."""
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def together(found: list[Raw], names: Sequence[str], place: str, faults: list[Fault]) -> Raw:
    """The values of several files of one characteristic, in their order, each file a lot of its own
    where it names none. Files of different revisions of the drawing, or units, are a fault.
    """
    if len(found) < 2:
        return found[0] if found else {}
    for key, what in REVISED.items():
        stated = {
            _stated(one[key]): name for one, name in zip(found, names, strict=True) if key in one
        }
        if len(stated) > 1:
            each = ", ".join(f"{value} in {name}" for value, name in stated.items())
            faults.append(
                Fault(
                    place,
                    f"mixes files of different {what} ({each}): of several "
                    "revisions of the drawing? Measure against one",
                )
            )
    whole: Raw = {}
    for one in found:
        whole |= one
    whole["values"] = [value for one in found for value in one["values"]]
    whole["lots"] = []
    for one, name in zip(found, names, strict=True):
        whole["lots"] += one.get("lots") or [Path(name).stem] * len(one["values"])
    return whole


@dataclass(frozen=True)
class MeasuredFile:
    """A file of measured parts, opened once: what its characteristics are called, by what each is
    asked for, and the values of one by its label.
    """

    place: str
    labels: tuple[str, ...]
    names: Mapping[str, str]
    values: Callable[[str], Raw]

    def named(self, wanted: Any) -> Raw:
        """The characteristic that is wanted, or the only one; raises InputError without it."""
        return self.values(_chosen(self.place, wanted, dict(self.names), list(self.labels)))


def measured_in(path: Path, wanted: Any, options: tables.ReadOptions) -> Raw:
    """The values of one characteristic of a file, and what the file says of them.

    Raises InputError where the file or the characteristic is not there.
    """
    return opened_parts(path, options).named(wanted)


def opened_parts(path: Path, options: tables.ReadOptions) -> MeasuredFile:
    """A file of measured parts. Raises InputError where it is not there, or cannot be read."""
    if path.suffix.lower() in SUFFIXES:
        return _of_aqdef(path, options)
    found = tables.opened_whole(path, path.name, options)
    names = {name: name for name in found.numeric}
    names |= {found.headers.get(name, name): name for name in found.numeric}

    def values(name: str) -> Raw:
        column, unit = found.frame[name].dropna(), found.units.get(name, "")
        return {"values": [float(one) for one in column]} | ({"unit": unit} if unit else {})

    return MeasuredFile(path.name, tuple(found.numeric), names, values)


def _of_aqdef(path: Path, options: tables.ReadOptions) -> MeasuredFile:
    known = [one for one in tables.read_aqdef(path, options.encoding) if not one.attributive]
    names = {key: one.label for one in known for key in (one.number, one.name, one.label) if key}
    labels = tuple(dict.fromkeys(one.label for one in known))
    return MeasuredFile(
        path.name,
        labels,
        names,
        lambda label: _values(next(one for one in known if one.label == label)),
    )


def _values(one: tables.Characteristic) -> Raw:
    """What a Q-DAS file says of a characteristic."""
    rows = [
        (value, lot)
        for value, lot in zip(one.values, one.batches, strict=True)
        if value is not None
    ]
    found: Raw = {"values": [float(value) for value, _ in rows], "characteristic": one.label}
    if any(lot for _, lot in rows):
        found["lots"] = [lot for _, lot in rows]
    if one.unit:
        found["unit"] = one.unit
    if one.nominal is not None:
        found["nominal"] = one.nominal
    if one.lower is not None and one.upper is not None:
        found["made_to"] = 0.5 * (one.upper - one.lower)
    return found


def _chosen(place: str, wanted: Any, names: dict[str, str], each: list[str]) -> str:
    """The characteristic that is wanted, or the only one there is."""
    if wanted is None and len(each) == 1:
        return each[0]
    if wanted is None:
        text = f"has {len(each)} characteristics: say which, characteristic = ...; it has "
        raise InputError([Fault(place, text + ", ".join(each))])
    if str(wanted) not in names:
        text = f'has no characteristic "{wanted}"{nearest(str(wanted), names)}; it has '
        raise InputError([Fault(place, text + ", ".join(each))])
    return names[str(wanted)]
