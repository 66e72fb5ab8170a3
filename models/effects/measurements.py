"""A table as effects receive it: columns by role, in fixed units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import Fault
from ...section import Array, Output
from ...units import converted
from ..measurable import NO_CHANGES, Changeable, Column, MeasurableModel, Role, ranks_of_units
from .effect import MOTION, Action, Effect, Measurements, Target, Values

# The play operator along a path, without a loop over its points.


MAX_REVERSAL_FRACTION = 0.1
"""Reversals per row above which rows are not a path."""
MOSTLY = 0.9
"""Fraction of the load's path that must go in the stated direction."""
TWIST = 0.1
"""[rad] Largest twist of a locked unit."""


def play(x: Array, width: float, starts: NDArray[np.bool_] | None = None) -> Array:
    """Output (n,) of a play of half-width `width` [unit of x], driven along the path x (n,).

    p_i = max(x_i - w, min(x_i + w, p_(i-1))): the output rests until the input has crossed the
    play. A path begins where `starts` (n,) is true, at rest and never loaded before (p = 0 within
    the play). The steps are clips; clips compose to clips, so their running composition takes
    log2(n) passes over the whole path. Reference: Visintin, Differential Models of Hysteresis.
    """
    low, high = x - width, x + width
    begins = np.zeros(len(x), dtype=bool) if starts is None else starts.copy()
    begins[:1] = True
    fresh = np.clip(0.0, low[begins], high[begins])
    low[begins] = high[begins] = fresh  # a path does not depend on the path before it
    step = 1
    while step < len(x):
        # the clip of rows i-step+1..i after that of the rows before it
        before_low, before_high = low[:-step], high[:-step]
        new_low = np.clip(before_low, low[step:], high[step:])
        new_high = np.clip(before_high, low[step:], high[step:])
        low[step:], high[step:] = new_low, new_high
        step *= 2
    return low


def play_along_path(measurements: Measurements, x: Array, width: float) -> Array:
    """`play` over rows in the order of measurement; each unit and repeat has a separate path."""
    order, starts = measurements.in_order, path_starts(measurements)
    values = np.empty(len(x))
    values[order] = play(x[order], width, starts)
    return values


def follows_load(measurements: Measurements) -> bool:
    """Whether the rows are a load path on a unit at rest: the direction is that of the load's
    steps, it seldom reverses, and nothing moves.
    """
    load = next((role for role in (Role.TORQUE, Role.FORCE) if role in measurements), None)
    if load is None or Role.DIRECTION not in measurements or _has_motion(measurements):
        return False
    order, within = measurements.in_order, ~path_starts(measurements)[1:]
    steps = np.diff(np.asarray(measurements[load], dtype=float)[order])[within]
    sign = np.asarray(measurements[Role.DIRECTION], dtype=float)[order]
    reversals = int(np.count_nonzero(np.diff(sign)))
    along = float(0.5 * (sign[1:] + sign[:-1])[within] @ steps)
    return 0 < reversals <= MAX_REVERSAL_FRACTION * len(sign) and along > MOSTLY * float(np.abs(steps).sum())


def _has_motion(measurements: Measurements) -> bool:
    """Whether a speed is not 0, or the angle changes from row to row by more than a twist."""
    if Role.SPEED in measurements and np.any(measurements[Role.SPEED]):
        return True
    angle = measurements[Role.ANGLE] if Role.ANGLE in measurements else np.zeros(len(measurements))
    steps = np.abs(np.diff(np.asarray(angle, dtype=float)[measurements.in_order]))
    return bool(np.ptp(angle) > TWIST and np.median(steps) > 0.0)


def path_starts(measurements: Measurements) -> NDArray[np.bool_]:
    """Where (n,) a path begins, in the order of measurement: in each unit, repeat and session."""
    order, starts = measurements.in_order, np.zeros(len(measurements), dtype=bool)
    starts[:1] = True
    columns = [measurements[role] for role in (Role.UNIT, Role.REPEAT) if role in measurements]
    for column in (*columns, *(measurements.table[name] for name in (SESSION,) if name in measurements.table)):
        labels = column[order]
        starts[1:] |= np.asarray(labels[1:] != labels[:-1], dtype=bool)
    return starts


DRIVING = (Role.ANGLE, Role.TORQUE, Role.FORCE, Role.INPUT)
"""Roles of columns that may drive an effect with memory."""
LEAST_PATH = 20
"""Steps of a path, at least."""
LEAST_REVERSALS = 2
"""Times that a path turns back, at least, before a hysteresis shows in it."""
SMALL = 0.1
"""Squared steps of a path, as a fraction of those of rows in random order."""


def path_of(measurements: Measurements, role: Role, units: Mapping[Role, str]) -> Array:
    """The column (n,) of that role; the travel [rad or m], integrated from the speed, where there is no angle."""
    if role is not Role.ANGLE or role in measurements:
        return np.asarray(measurements[role], dtype=float)
    order, starts = measurements.in_order, path_starts(measurements)
    speed = np.asarray(measurements[Role.SPEED] * measurements[Role.DIRECTION], dtype=float)[order]
    time = np.asarray(measurements[Role.TIME], dtype=float)[order]
    steps = 0.5 * (speed[1:] + speed[:-1]) * np.where(starts[1:], 0.0, np.diff(time))
    travel = np.empty(len(speed))
    travel[order] = np.r_[0.0, np.cumsum(steps)]
    return travel if units.get(Role.SPEED) == "m/s" else travel * np.pi / 30.0


def _paths_of(measurements: Measurements, units: Mapping[Role, str]) -> tuple[dict[Role, float], frozenset[Role]]:
    """The ranges of the driving columns that are paths in the order of measurement, and which of them turn back."""
    within, order = ~path_starts(measurements)[1:], measurements.in_order
    if np.count_nonzero(within) < LEAST_PATH:
        return {}, frozenset()
    roles = [role for role in DRIVING if role in measurements]
    if Role.ANGLE not in measurements and {*measurements.by_role} >= MOTION:
        roles.append(Role.ANGLE)
    ranges, reversing = dict[Role, float](), set[Role]()
    for role in roles:
        x = path_of(measurements, role, units)[order]
        steps = np.diff(x)[within]
        if 0.0 < float(np.mean(steps**2)) < SMALL * 2.0 * float(np.var(x)):
            ranges[role] = float(np.ptp(x))
            senses = np.sign(steps[steps != 0.0])
            if np.count_nonzero(senses[1:] != senses[:-1]) >= LEAST_REVERSALS:
                reversing.add(role)
    return ranges, frozenset(reversing)


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
    units = FIXED.get(column.role, (column.unit,))
    for unit in units:
        with suppress(ValueError):
            converted(0.0, column.unit, unit)
            return unit
    raise ValueError(f'"{column.unit}" is no unit of a {column.role} (write {" or ".join(units)})')


def measurements_of(columns: Iterable[Column], table: Table) -> Measurements:
    """The rows of `table` (columns (n,) by name) by role; the first column of a role counts.

    Raises ValueError where a column's unit does not fit its role.
    """
    by_role: dict[Role, NDArray[Any]] = {}
    for column in _available_columns(columns, table):
        if column.role not in by_role:
            values, unit = table[column.name], fixed_unit(column)
            if not column.text and column.unit != unit:
                values = np.asarray(converted(np.asarray(values, dtype=float), column.unit, unit))
            by_role[column.role] = -values if column.sense < 0 else values
    _split_signed_speed(by_role)
    order = _order_of(by_role[Role.TIME], table.get(SESSION)) if Role.TIME in by_role else None
    return Measurements(table, by_role, order)


def _order_of(time: NDArray[Any], session: NDArray[Any] | None) -> NDArray[np.int64]:
    """Rows in the order of measurement: by the clock, one session after the other where each
    session has a clock of its own.
    """
    if session is None or not has_session_clocks(session, time):
        return np.argsort(time, kind="stable")
    return np.lexsort((time, _number_by_appearance(session)))


def has_session_clocks(session: NDArray[Any], time: NDArray[Any]) -> bool:
    """Whether each session has a clock of its own: they follow each other in the file, and their
    times overlap.
    """
    number = _number_by_appearance(session)
    steps = np.diff(number)
    if len(number) == 0 or number[-1] == 0 or (steps < 0).any():
        return False
    starts = np.r_[0, np.flatnonzero(steps) + 1]
    first, last = np.minimum.reduceat(time, starts), np.maximum.reduceat(time, starts)
    return bool((first[1:] <= last[:-1]).any())


def _number_by_appearance(labels: NDArray[Any]) -> NDArray[np.int64]:
    """Number (n,) of each of the labels (n,) or columns of labels (k, n), by first appearance."""
    _, first, inverse = np.unique(np.asarray(labels).astype(str), axis=-1, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return np.asarray(rank[inverse.ravel()])


def _split_signed_speed(by_role: dict[Role, NDArray[Any]]) -> None:
    """Replace a signed speed by its magnitude and, where there is none, the direction."""
    if Role.SPEED not in by_role:
        return
    speed = np.asarray(by_role[Role.SPEED], dtype=float)
    if Role.DIRECTION not in by_role:
        by_role[Role.DIRECTION] = np.sign(speed)
    by_role[Role.SPEED] = np.abs(speed)


def _derive_roles(roles: set[Role], measurements: Measurements | None) -> frozenset[Role]:
    """Roles that follow from another column: the direction from the sign of a speed."""
    if Role.SPEED not in roles or Role.DIRECTION in roles:
        return frozenset()
    moves = measurements is None or np.any(measurements[Role.DIRECTION])
    return frozenset([Role.DIRECTION] if moves else [])


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
    if table is not None:
        columns = tuple(_available_columns(columns, table))
    units = {column.role: fixed_unit(column) for column in reversed(columns)}
    roles = {column.role for column in columns}
    derived, several = _derive_roles(roles, None), len(outputs) > 1
    target = Target(name, outputs, columns, changeable, population, several, units=units, derived=derived)
    if table is None:
        return target
    measurements = measurements_of(columns, table)
    numbers = {role: v for role, v in measurements.by_role.items() if role in FIXED}
    largest = {role: float(np.max(np.abs(v), initial=0.0)) for role, v in numbers.items()}
    labels = {role: tuple(labels_of(measurements[role])[0].tolist()) for role in LABELS if role in measurements}
    paths, reversing = ({}, frozenset()) if population else _paths_of(measurements, units)
    return replace(
        target,
        largest=largest,
        labels=labels,
        locked=follows_load(measurements),
        pace=pace_of(measurements),
        derived=_derive_roles(roles, measurements),
        paths=paths,
        reversing=reversing,
    )


def pace_of(measurements: Measurements) -> float:
    """The usual step of the clock [s], 0 without one."""
    return usual_step(np.asarray(measurements[Role.TIME], dtype=float), 0.0) if Role.TIME in measurements else 0.0


def usual_step(time: Array, otherwise: float) -> float:
    """The median of the positive steps of a clock (n,) [s], `otherwise` where there are none."""
    steps = np.diff(time)
    ahead = steps[steps > 0.0]
    return float(np.median(ahead)) if len(ahead) else otherwise


def _available_columns(columns: Iterable[Column], table: Table) -> list[Column]:
    return [column for column in columns if column.name in table]


def labels_of(values: NDArray[Any]) -> tuple[NDArray[np.str_], NDArray[np.int64]]:
    """The labels (k,) of a column in their order, and the index (n,) of each row's label.

    A whole number is written without its decimals.
    """
    names, inverse = np.unique(np.asarray(values).astype(str), return_inverse=True)
    if np.asarray(values).dtype.kind == "f":
        names = np.array([name.removesuffix(".0") for name in names.tolist()], dtype=str)
    return names, np.asarray(inverse, dtype=np.int64)


def _are_numbers(labels: NDArray[Any]) -> bool:
    """Whether labels are numbers."""
    return labels.dtype.kind in "fiu" or all(str(label).isdecimal() for label in labels.tolist())


def unit_numbers(measurements: Measurements) -> NDArray[np.int64]:
    """Number (n,) of the unit of each row, in the order of measurement, from 0.

    Without a time that is the order of the units' own numbers; units with other labels are in the
    order of the rows. Rows with the same labels of unit and lot are one unit where the table has repeats; otherwise
    each row is a unit.
    """
    order, numbers = measurements.in_order, np.empty(len(measurements), dtype=np.int64)
    if measurements.order is None and Role.UNIT in measurements and _are_numbers(measurements[Role.UNIT]):
        labels = {role.value: measurements[role] for role in LABELS if role in measurements}
        order = np.argsort(ranks_of_units(labels))
    if Role.REPEAT in measurements and Role.UNIT in measurements:
        codes = [labels_of(measurements[role][order])[1] for role in LABELS if role in measurements]
        numbers[order] = _number_by_appearance(np.stack(codes))
    else:
        numbers[order] = np.arange(len(measurements))
    return numbers


# Effects in a model: its predictions with them, composed in a fixed order.
#
# 1. Changes inside of the model, summed over the effects; 2. the model's prediction; 3. the
# population, effect after effect; 4. the sum of what is added to the outputs; 5. the
# measurement, effect after effect. Within 3 and 5 effects act in the order in which they are listed.


@dataclass(frozen=True, slots=True)
class Active:
    """An active effect of the model, with the values of its parameters by name."""

    effect: Effect
    values: Values


NO_RANGES: Mapping[str, tuple[float, float]] = {}


def predicted(
    model: MeasurableModel,
    name: str,
    table: Table,
    effects: Iterable[Active],
    rng: np.random.Generator,
    zero: Mapping[str, float] = NO_CHANGES,
    record: Mapping[str, tuple[float, float]] = NO_RANGES,
) -> dict[str, Array]:
    """Every output (n,) of the model `name` at the rows of a table, with the effects in it.

    `zero` is added to the model's predictions, by output. Outside of the ranges of the inputs in a `record` an
    effect that `holds_at_ends` stays at its value at the end.
    """
    active = tuple(effects)
    if not active:
        return add_zero(model.predict(table, rng), zero)
    target = target_of(model, name, table)
    measurements = measurements_of(target.columns, table)
    held = {name: np.clip(table[name], *ends) for name, ends in record.items() if name in table}
    at_ends = measurements_of(target.columns, {**table, **held}) if held else measurements
    actions = [
        entry.effect.act(at_ends if entry.effect.holds_at_ends else measurements, entry.values, target)
        for entry in active
    ]
    changes = changes_of(actions) or NO_CHANGES
    outputs = add_zero(model.predict(table, rng, changes), zero)
    means = model.means(changes) if any(action.population for action in actions) else {}
    return apply_output_actions(outputs, actions, means, rng)


def add_zero(outputs: Mapping[str, Array], zero: Mapping[str, float]) -> dict[str, Array]:
    """Outputs (n,) with the zero of the instrument added to each of them."""
    return {name: values + zero[name] if name in zero else values for name, values in outputs.items()}


def effect_actions(effects: Sequence[Active], measurements: Measurements, target: Target) -> list[Action]:
    """The action of each effect on the rows."""
    return [effect.effect.act(measurements, effect.values, target) for effect in effects]


def pathless_effects(effects: Iterable[Active], target: Target) -> list[Fault]:
    """Faults of stated effects with a memory, of a table whose rows are no path for them."""
    lacking = ((one.effect.name, one.effect.lacks_path(target)) for one in effects)
    return [Fault("effect", f"{name} has no place in these rows: {why}") for name, why in lacking if why]


def changes_of(actions: Iterable[Action]) -> dict[str, Array]:
    """Changes inside of the model, summed over the effects."""
    changes: dict[str, Array] = {}
    for action in actions:
        for name, change in action.changes.items():
            changes[name] = changes[name] + change if name in changes else change
    return changes


def changes_of_reading(
    effect: Effect, values: Values, parts: Mapping[str, Array], measurements: Measurements, target: Target
) -> list[Array]:
    """By how much an effect on the reading changes parts (n,) of the outputs, by name."""
    read = effect.act(measurements, values, target).reading
    return [read[name](part) - part if name in read else 0.0 * part for name, part in parts.items()]


def apply_output_actions(
    outputs: Mapping[str, Array], actions: Sequence[Action], means: Mapping[str, float], rng: np.random.Generator
) -> dict[str, Array]:
    """Predicted outputs (n,) with the effects that act on them; `means` are of a population."""
    total = dict(outputs)
    for action in actions:
        if action.population is not None:
            for name in total:
                total[name] = action.population(total[name], means[name], rng)
    for action in actions:
        for name, more in action.output.items():
            total[name] = total[name] + more
    for action in actions:
        for name, measured in action.reading.items():
            total[name] = measured(total[name])
    return total
