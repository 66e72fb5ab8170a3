"""A table as effects see it: columns by role, in fixed units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...declarations import Output
from ...units import converted
from ..measurable import Changeable, Column, MeasurableModel, Role
from .effect import Readings, Target
from .path import follows_load

Table = Mapping[str, NDArray[Any]]

FIXED: Mapping[Role, tuple[str, ...]] = {
    Role.ANGLE: ("rad", "m"),
    Role.TORQUE: ("Nm",),
    Role.FORCE: ("N",),
    Role.SPEED: ("rpm", "m/s"),
    Role.TEMPERATURE: ("C",),
    Role.TIME: ("s",),
    Role.PAYLOAD: ("kg",),
    Role.POSITION: ("m",),
}
"""Units by role; the second is that of linear motion."""
LABELS = (Role.UNIT, Role.LOT)
SESSION = "session"
"""A column that any table may have: the rows that were measured in one session."""
EXTRAS = (
    Column("time_s", "s", "order of measuring", False, role=Role.TIME),
    Column("repeat", "", "number of the repeat", False, role=Role.REPEAT),
)
"""Columns that any table may add."""


def fixed_unit(column: Column) -> str:
    """The unit in which effects receive a column. Raises ValueError where its own does not fit."""
    units = FIXED.get(column.role, ())
    for unit in units:
        try:
            converted(0.0, column.unit, unit)
        except ValueError:
            continue
        return unit
    if units:
        text = f'"{column.unit}" is no unit of a {column.role} (write {" or ".join(units)})'
        raise ValueError(text)
    return column.unit


def readings_of(columns: Iterable[Column], table: Table) -> Readings:
    """The rows of `table` (columns (n,) by name) by role; the first column of a role counts.

    Raises ValueError where a column's unit does not fit its role.
    """
    by_role: dict[Role, NDArray[Any]] = {}
    for column in _present(columns, table):
        if column.role not in by_role:
            values = table[column.name]
            unit = fixed_unit(column)
            converted = values if column.text else _in_unit(values, column.unit, unit)
            by_role[column.role] = -converted if column.sense < 0 else converted
    _turn_by_speed(by_role)
    order = _order(by_role[Role.TIME], table.get(SESSION)) if Role.TIME in by_role else None
    return Readings(table, by_role, order)


def _order(time: NDArray[Any], session: NDArray[Any] | None) -> NDArray[np.int64]:
    """Rows in the order of measurement: by the clock, session by session where each has its own."""
    if session is None or not own_clocks(session, time):
        return np.argsort(time, kind="stable")
    return np.lexsort((time, _appearance(session)))


def own_clocks(session: NDArray[Any], time: NDArray[Any]) -> bool:
    """Whether each session has a clock of its own: they follow each other in the file, and their
    times overlap.
    """
    number = _appearance(session)
    steps = np.diff(number)
    if len(number) == 0 or number[-1] == 0 or (steps < 0).any():
        return False
    starts = np.r_[0, np.flatnonzero(steps) + 1]
    first, last = np.minimum.reduceat(time, starts), np.maximum.reduceat(time, starts)
    return bool((first[1:] <= last[:-1]).any())


def _appearance(labels: NDArray[Any]) -> NDArray[np.int64]:
    """Number (n,) of each row's label, by first appearance."""
    _, first, inverse = np.unique(np.asarray(labels).astype(str), return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return np.asarray(rank[inverse.ravel()])


def _turn_by_speed(by_role: dict[Role, NDArray[Any]]) -> None:
    """A signed speed gives the direction: effects receive magnitude and direction."""
    if Role.SPEED not in by_role:
        return
    speed = np.asarray(by_role[Role.SPEED], dtype=float)
    if Role.DIRECTION not in by_role:
        by_role[Role.DIRECTION] = np.sign(speed)
    by_role[Role.SPEED] = np.abs(speed)


def _derived(roles: set[Role], readings: Readings | None) -> frozenset[Role]:
    """Roles that follow from another column: the direction from a speed of both signs."""
    if Role.SPEED not in roles or Role.DIRECTION in roles:
        return frozenset()
    if readings is not None and np.ptp(readings[Role.DIRECTION]) == 0.0:
        return frozenset()
    return frozenset([Role.DIRECTION])


def _in_unit(values: NDArray[Any], unit: str, fixed: str) -> NDArray[Any]:
    if not fixed or unit == fixed:
        return values
    return np.asarray(converted(np.asarray(values, dtype=float), unit, fixed))


def target_of(model: MeasurableModel | type[MeasurableModel], name: str, table: Table | None = None) -> Target:
    """The target of effects in a model; with a known table, only of the columns that it has."""
    columns = (*model.columns, *(extra for extra in EXTRAS if table is None or extra.name in table))
    target = target_from(name, model.outputs, columns, table, model.changeable, model.population)
    return replace(target, gear=model.gear)


def target_from(
    name: str,
    outputs: tuple[Output, ...],
    columns: tuple[Column, ...],
    table: Table | None = None,
    changeable: tuple[Changeable, ...] = (),
    population: bool = False,
) -> Target:
    """A target of these columns; with a table, only of those it has, with the ranges of its values.

    Raises ValueError where a column's unit does not fit its role.
    """
    several = len(outputs) > 1
    if table is not None:
        columns = tuple(_present(columns, table))
    units = {column.role: fixed_unit(column) for column in reversed(columns)}
    roles = {column.role for column in columns}
    target = Target(name, outputs, columns, changeable, population, several, units=units, derived=_derived(roles, None))
    if table is None:
        return target
    readings = readings_of(columns, table)
    numbers = {role: v for role, v in readings.by_role.items() if role in FIXED}
    largest = {role: float(np.max(np.abs(v), initial=0.0)) for role, v in numbers.items()}
    labels = {role: tuple(labels_of(readings[role])[0].tolist()) for role in LABELS if role in readings}
    return replace(
        target,
        largest=largest,
        labels=labels,
        locked=follows_load(readings),
        pace=pace_of(readings),
        derived=_derived(roles, readings),
    )


def pace_of(readings: Readings) -> float:
    """The usual step of the clock [s], 0 without one."""
    if Role.TIME not in readings:
        return 0.0
    steps = np.diff(np.asarray(readings[Role.TIME], dtype=float))
    ahead = steps[steps > 0.0]
    return float(np.median(ahead)) if len(ahead) else 0.0


def _present(columns: Iterable[Column], table: Table) -> list[Column]:
    return [column for column in columns if column.name in table]


def labels_of(values: NDArray[Any]) -> tuple[NDArray[np.str_], NDArray[np.int64]]:
    """The labels (k,) of a column in their order, and the index (n,) of each row's label.

    A whole number is written without its decimals.
    """
    names, inverse = np.unique(np.asarray(values).astype(str), return_inverse=True)
    if np.asarray(values).dtype.kind == "f":
        names = np.array([name.removesuffix(".0") for name in names.tolist()], dtype=str)
    return names, np.asarray(inverse, dtype=np.int64)


def unit_numbers(readings: Readings) -> NDArray[np.int64]:
    """Number (n,) of the unit of each row, in the order of measurement, from 0.

    Rows of one unit (and lot) are one unit where the table has repeats; otherwise each row is one.
    """
    order = np.arange(len(readings)) if readings.order is None else readings.order
    numbers = np.empty(len(readings), dtype=np.int64)
    if Role.REPEAT not in readings or Role.UNIT not in readings:
        numbers[order] = np.arange(len(readings))
        return numbers
    codes = [labels_of(readings[role][order])[1] for role in LABELS if role in readings]
    _, first, inverse = np.unique(np.stack(codes), axis=1, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))  # by first appearance
    numbers[order] = rank[inverse.ravel()]
    return numbers
