"""`built_to`: the allocation that the units of a batch were built to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from .. import tables
from ..declarations import Variable
from ..directory import kind_of, standing
from ..errors import Fault, nearest, raise_all, refuse
from ..files import is_file, is_folder
from ..section import Range, Section, shown
from .configuration import Configuration
from .reader import read

ALLOCATION, FRONT, CONFIG = "allocation.csv", "front.csv", "config.toml"
CHOICE = ("choice", "point", "variable", "rounded")
"""Columns by which the allocation of a run is recognised."""
FORMS = 'a run\'s allocation.csv, a table of designs, or { run = "runs/x", point = "knee" }'


@dataclass(frozen=True)
class Built:
    """Values by variable, where they come from, and the run whose directory holds them."""

    values: Mapping[str, float] = field(default_factory=dict)
    source: str = ""
    run: Configuration | None = None


def read_built(top: Section, folder: Path, variables: Iterable[Variable]) -> Built | None:
    """The allocation that `built_to` names, None where there is none or it is at fault."""
    stated = top.take("built_to")
    if stated is None:
        return None
    inner = top.of("built_to", stated if isinstance(stated, dict) else {"file": stated})
    key = "run" if "run" in inner else "file"
    name, point = inner.text(key), inner.take("point")
    if key == "run" and "file" in inner:
        inner.fault("file", "is given in addition to run: leave out one of the two")
        inner.take("file")
    inner.finish()
    if name is None:
        if not isinstance(stated, str | dict) or key not in inner:
            top.fault("built_to", f"must name {FORMS}, got {shown(stated)}")
        return None
    place = inner.place(key) if isinstance(stated, dict) else "built_to"
    known = {variable.name: variable for variable in variables}
    return top.attempt(
        lambda: _allocation(folder / name, name, point, known),
        lambda fault: (place, f"{fault.place} {fault.message}".lstrip()),
    )


def _allocation(path: Path, name: str, point: Any, variables: Mapping[str, Variable]) -> Built:
    """The values, and the run that they come from. Raises InputError."""
    home = path if is_folder(path) else path.parent
    run = _run_of(home)
    if is_folder(path):
        if run is None:
            raise refuse("", f"{name} is not the directory of a run; name {FORMS}")
        path = home / (FRONT if isinstance(point, int) else ALLOCATION)
    frame = tables.opened_whole(path, path.name, tables.NO_OPTIONS).cells
    if set(CHOICE) <= set(frame):
        values, origin = _of_choices(frame, path.name, point)
    else:
        values, origin = _of_designs(frame, path.name, point, path.name == FRONT and run is not None)
    _check(values, path.name, variables)
    return Built({k: float(v) for k, v in values.items()}, f"{name}, {origin}", run)


def _run_of(folder: Path) -> Configuration | None:
    """The configuration of the run that a directory holds. Raises InputError where it is bad."""
    if kind_of(folder) != "run" or not is_file(folder / CONFIG):
        return None
    raise_all(standing(folder).faults)
    configuration = read(folder / CONFIG)
    return configuration if configuration.problem is not None else None


def _of_choices(frame: pd.DataFrame, place: str, point: Any) -> tuple[dict[str, Any], str]:
    """The rounded values of one chosen point of `allocation.csv`."""
    by = {(str(label), str(at)): part for (label, at), part in frame.groupby(["choice", "point"], sort=False)}
    names = ", ".join(label for label, _ in by)
    if point is None and len(by) > 1:
        raise refuse(
            "",
            f"{place} holds {len(by)} chosen points ({names}): say which, as "
            f'built_to = {{ run = "...", point = "{next(iter(by))[0].split()[0]}" }}',
        )
    chosen = [
        part
        for (label, at), part in by.items()
        if point is None or str(point) in (label, at) or str(point) in label.split()
    ]
    if len(chosen) != 1:
        words = [word for label, _ in by for word in label.split()]
        raise refuse("", f"point {shown(point)} is not in {place}{nearest(str(point), words)}: it holds {names}")
    label_of_point = str(chosen[0]["choice"].iloc[0]) if point is None else str(point)
    return dict(zip(chosen[0]["variable"], chosen[0]["rounded"], strict=True)), f"point {label_of_point}"


def _of_designs(frame: pd.DataFrame, place: str, point: Any, front: bool) -> tuple[dict[str, Any], str]:
    """One row of a table of designs. Rows are counted from 1, those of a front from 0."""
    first = 0 if front else 1
    if point is None and len(frame) > 1:
        last = first + len(frame) - 1
        raise refuse(
            "",
            f'{place} holds {len(frame)} designs: say which, as built_to = {{ file = "...'
            f'", point = {first} }} ({first} to {last})',
        )
    at = 0 if point is None else point
    if point is not None:
        if isinstance(point, bool) or not isinstance(point, int):
            raise refuse("", f"point must be the number of a row of {place}, got {shown(point)}")
        at = point - first
        if not 0 <= at < len(frame):
            raise refuse("", f"point {point} is not in {place}: it has rows {first} to {first + len(frame) - 1}")
    return {str(name): value for name, value in frame.iloc[at].items()}, f"row {at + first}"


def _check(values: dict[str, Any], place: str, variables: Mapping[str, Variable]) -> None:
    """Values as numbers within what they may be; other columns of a table are left out."""
    known = [name for name in values if name in variables]
    if not known:
        raise refuse(
            "", f"{place} is an allocation of another problem: it has none of {', '.join(list(variables)[:6])}, ..."
        )
    faults = []
    for name in values if "cost" not in values else ():
        if name not in variables:
            text = f"column {name} is not a variable{nearest(name, variables)}"
            faults.append(Fault("", f"{place}: {text}; is it an allocation of another problem?"))
    for name in known:
        variable = variables[name]
        try:
            complaint = Range(variable.valid_low, variable.valid_high).complaint(float(values[name]))
        except ValueError:
            complaint = f"must be a number, got {shown(values[name])}"
        if complaint:
            faults.append(Fault("", f"{place}: {name} {complaint}"))
    raise_all(faults)
    for name in [n for n in values if n not in known]:
        del values[name]
