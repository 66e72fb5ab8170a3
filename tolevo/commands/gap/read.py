"""Reads and checks the table of a gap analysis, every fault at once; notes on implausible units."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import radians, tau
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ... import tables
from ...configuration.columns import output_of
from ...errors import Fault, abbreviated_list, nearest, raise_all
from ...models.effects.angle import unheld_orders
from ...models.effects.effect import kind_of
from ...models.effects.measurements import SESSION, pathless_effects
from ...models.measurable import Column, Role
from ...section import Array, Output
from ...units import converted
from .data import (
    MIN_UNITS,
    GapData,
    assemble_data,
    average_repeats,
    clock_faults,
    copied_rows_messages,
    late_clock_messages,
    number_units,
    of_one_measurement,
    too_few_units_fault,
)
from .fit import Fit
from .plan import GapPlan, alike, column_messages


def range_faults(plan: GapPlan, data: GapData, place: str) -> list[Fault]:
    """Faults of ranges of missing columns, of past times, and of ranges without a point."""
    from .next_field import NO_POINT, RANGE, axes_of, candidates, rows_in_range  # it needs a setup, which reads

    wanted = plan.next_measurement
    if wanted is None:
        return []
    known = {column.name: column for column in data.target.columns}
    faults = []
    for name, span in wanted.ranges.items():
        text = ""
        if name not in known:
            text = f"{place} has no such column, so the next table has none either; remove this range"
        elif known[name].role is Role.TIME:
            last = float(data.values(name).max())
            text = f"ends before the record, at {last:g}" if span.high <= last else ""
        if text:
            faults.append(Fault(f"{RANGE}.{name}", text))
    if not faults and not data.target.population:
        points = candidates(data, axes_of(data, wanted.ranges, wanted.readings), plan.seed)
        faults += [] if rows_in_range(plan.model, points).any() else [Fault(RANGE, NO_POINT)]
    return faults


PLAUSIBLE_MAXIMA = {
    Role.ANGLE: (1000.0 * tau, "1000 turns"),
    Role.TORQUE: (1e6, "1e6 N m"),
    Role.FORCE: (1e7, "1e7 N"),
    Role.SPEED: (1e5, "1e5 rpm"),
    Role.TEMPERATURE: (200.0, "200 degC, above which greases and oils decompose"),
    Role.PAYLOAD: (1e5, "1e5 kg"),
    Role.POSITION: (1e3, "1 km"),
    Role.TIME: (3e8, "ten years"),
}
"""Span or magnitude, in the units of `Measurements`, that is beyond a test bench."""
MIN_TURN_RAD = radians(0.5)
"""[rad] Span that a turning angle exceeds; that of a unit with locked input does not."""
FACTOR = 20.0
"""Ratio of a measurement to its prediction that is implausible in the same unit."""
STIFFER = 100.0
"""Factor by which a part of a drive's compliance may be stiffer than the drive."""
FOLLOWS = 0.7
"""Correlation from which a measurement follows the load."""
STIFFNESS = {("angle", "Nm"): ("arcmin", 1e-3, 2e4), ("length", "N"): ("um", 1e-3, 1e5)}
"""By kind of output and load: a unit, and the range of the stiffness of drives in load per unit.
Reducers have 0.1 to 5000 N m/arcmin, from small harmonic drives to large cycloidal ones; screws 1
to 5000 N/um.
"""
MIN_FOLLOWING_RATIO = 0.9
"""Correlation from which a measurement and its prediction are of the same quantity."""


def implausible_unit_sentences(data: GapData) -> list[str]:
    """Sentences about columns whose unit is probably not the stated one."""
    return [*_implausible_magnitudes(data), *_still_angle_note(data), *_scale_note(data), *_stiffness_note(data)]


def _implausible_magnitudes(data: GapData) -> Iterator[str]:
    for role, (most, text) in PLAUSIBLE_MAXIMA.items():
        if role not in data.measurements or data.target.units.get(role) in ("m", "m/s"):
            continue
        x = np.asarray(data.measurements[role], dtype=float)
        size = np.ptp(x) if role in (Role.ANGLE, Role.TIME) else np.abs(x).max(initial=0.0)
        if size > most:
            yield f"{_doubt(data, role)} It reaches beyond {text}"


def _still_angle_note(data: GapData) -> Iterator[str]:
    """An angle that hardly turns, on a unit that is not locked."""
    turning = data.target.units.get(Role.ANGLE) == "rad" and Role.POSITION not in data.measurements
    span = float(np.ptp(data.measurements[Role.ANGLE])) if turning else 0.0
    if 0.0 < span < MIN_TURN_RAD and not data.target.locked:
        yield f"{_doubt(data, Role.ANGLE)} It spans {np.degrees(span):.2g} deg in all"


def _scale_note(data: GapData) -> Iterator[str]:
    """A measurement that is many times its prediction, or a small part of it."""
    for output in data.outputs:
        if output.name not in data.predicted:
            continue
        factor = _factor(data.measured[output.name], data.predicted[output.name])
        if factor > FACTOR or 0.0 < factor < 1.0 / FACTOR:
            yield (
                f"is the unit of {output.name} or that of its prediction wrong? They are correlated, "
                f"but it is {factor:.4g} times as large"
            )


def _stiffness_note(data: GapData) -> Iterator[str]:
    """A measurement that follows the load as that of no gear or axis does."""
    role = next((r for r in (Role.TORQUE, Role.FORCE) if r in data.measurements), None)
    if role is None or data.target.population:
        return
    load = np.asarray(data.measurements[role], dtype=float)
    for output in data.outputs:
        y = data.measured[output.name]
        spread = float(np.std(load) * np.std(y))
        slope = float(np.cov(load, y, bias=True)[0, 1]) / max(float(np.var(load)), 1e-300)
        if spread > 0.0 and abs(slope) * np.std(load) > FOLLOWS * np.std(y):
            description = unlikely_stiffness(1.0 / slope, output.unit, "N" if role is Role.FORCE else "Nm")
            if description:
                doubt = f"{_doubt(data, role)} Or that of {output.name}?"
                yield f"{doubt} It follows the load with a stiffness of {description}"


def unlikely_stiffness(stiffness: float, unit: str, load: str, more: float = 1.0) -> str:
    """The description of a stiffness [load per unit] that no drive has, else empty.

    A compliance in addition to a simulation may be stiffer than a drive by the factor `more`.
    """
    kind = kind_of(unit)
    if (kind, load) not in STIFFNESS:
        return ""
    shown, low, high = STIFFNESS[kind, load]
    magnitude = abs(stiffness) / float(converted(1.0, unit, shown))
    if low <= magnitude <= high * more:
        return ""
    return f"{magnitude:.3g} {load}/{shown}; drives have {low:g} to {high:g}"


def unlikely_numbers(fit: Fit, data: GapData) -> list[str]:
    """Sentences about fitted compliances that no drive has."""
    load = "Nm" if Role.TORQUE in data.measurements else "N"
    return [
        f"the stiffness of {member.name} in {output.name} is {description}: are the units right?"
        for member, sizes in zip(fit.members, fit.coefficients, strict=True)
        if member.candidate.effect.of_stiffness
        for output, size in zip(member.candidate.effect.reached(data.target), sizes, strict=False)
        if size > 0.0 and (description := unlikely_stiffness(1.0 / float(size), output.unit, load, STIFFER))
    ]


def _factor(measured: Array, predicted: Array) -> float:
    """The ratio of the measurement to the prediction; 0 where they are not correlated."""
    spread = float(np.std(measured) * np.std(predicted))
    covariance = float(np.cov(measured, predicted, bias=True)[0, 1])
    if spread == 0.0 or covariance < MIN_FOLLOWING_RATIO * spread:
        return 0.0
    return covariance / float(np.var(predicted))


def _doubt(data: GapData, role: Role) -> str:
    column = next(c for c in data.target.columns if c.role is role)
    return f'is "{column.unit}" the unit of {column.name}?'


TIME = Column("time_s", "s", "order of measuring", False, role=Role.TIME)
VARIATION_TOLERANCE = 1e-12
"""Relative range below which measurements count as all the same."""
NO_DIRECTION = "a direction is +1 or -1; remove the column where a speed has its sign, otherwise the rows at rest"
NO_NOISE = "must be above 0; remove the column where the noise is not known"
NO_VARIATION = (
    "no input varies: every row repeats the same measurement, and no cause can be identified; "
    "vary an input, or add time_s"
)
NO_PREDICTION = "the model has no finite prediction here: outside of its range; remove the row"
REPEAT = Column("repeat", "", "number of the repeat", False, role=Role.REPEAT)
MAX_MEASURABLE = 1e100
"""Largest measurement: its square is still finite."""
ABSOLUTE_ZERO = -273.15
"""[degC]"""


def read_data(plan: GapPlan, path: Path, options: tables.ReadOptions = tables.AS_DETECTED) -> GapData:
    """The data in `path`. Raises InputError with every fault; rows have their line numbers."""
    data, faults = checked(plan, path, options)
    raise_all(faults)
    assert data is not None
    return data


def checked(
    plan: GapPlan | None, path: Path, options: tables.ReadOptions = tables.AS_DETECTED
) -> tuple[GapData | None, list[Fault]]:
    """The data in `path`, or every fault in them; without a plan only faults of the form."""
    return checked_table(plan, *tables.open_table(path, path.name, options), path.name, path)


def checked_table(
    plan: GapPlan | None, table: tables.Table | None, faults: list[Fault], place: str, path: Path | None = None
) -> tuple[GapData | None, list[Fault]]:
    """`checked` for a table that has been opened, from a file or not, with faults of its form."""
    if plan is None or table is None:
        return None, faults
    fitted = tables.fit_columns(table, place, _units(plan), plan.uses)
    cells, faults = fitted.cells, [*faults, *fitted.faults]
    columns, outputs, predictions, stds = _layout(plan, cells)
    notes: list[str] = []
    population = plan.model is not None and plan.model.population
    if population:
        cells = number_units(cells, columns, place, notes)
    faults += _missing_outputs(plan, cells, outputs, place)
    needed = [*(c.name for c in columns if c.needed), *predictions.values()]
    wanted = [*(c.name for c in columns), *(o.name for o in outputs), *predictions.values(), *stds.values()]
    labels = [] if plan.blocks in ("auto", *wanted) or plan.blocks not in cells else [plan.blocks]
    sessions_unread = SESSION not in (*labels, *wanted)
    labels += [SESSION] if sessions_unread else []
    # a column of the role "ignore" may still be the validation column
    ignored = [n for n, c in plan.columns.items() if c.role == "ignore" and n in cells and n != plan.blocks]
    unused = _unused(plan, cells, ignored, [*needed, *wanted, *labels])
    frame, new_faults = tables.parse_columns(
        cells.drop(columns=[*ignored, *unused]),
        place,
        needed=needed,
        optional=[*wanted, *labels],
        text={c.name for c in columns if c.text} | set(labels),
    )
    frame, new_faults = _drop_bad_rows(plan, frame, new_faults, place, notes)
    faults += new_faults + _block_faults(plan, cells, frame, place)
    if not faults and plan.model is not None:
        if population:
            frame, new_faults = average_repeats(frame, columns, place, notes)
            faults += new_faults
        else:
            faults += too_few_units_fault(frame, columns, place)
    if len(cells):
        faults += _content_faults(plan, frame, columns, outputs, predictions, stds, place)
        faults += clock_faults(frame, columns, place)
    if faults:
        return None, faults
    present = tuple(c for c in columns if c.name in frame)
    notes += [
        f"no column {c.name} ({c.meaning}): what depends on it cannot be detected, and "
        "where it varied another effect may be identified instead"
        for c in columns
        if c.name not in frame and c not in (TIME, REPEAT) and not (population and of_one_measurement(c))
    ]
    if sessions_unread and SESSION in frame:
        notes.append(
            f"every {SESSION} may have a separate level; [validation] blocks = "
            f'"{SESSION}" would hold out each {SESSION} in turn'
        )
    notes += [*column_messages(frame, present), *late_clock_messages(frame, present), *copied_rows_messages(frame)]
    if unused:
        notes.append(f"not used, without a role: {abbreviated_list(unused)} (docs/conventions.md lists the roles)")
    data = assemble_data(plan, frame, present, outputs, predictions, stds, notes)
    faults = [*range_faults(plan, data, place), *pathless_effects(plan.active, data.target)]
    if faults := [*faults, *unheld_orders(data.measurements, data.target)]:
        return None, faults
    understood = (*table.lines(place), *(f"{place}: {note}" for note in fitted.notes))
    data = replace(data, understood=understood, table=table.record(), digest=_digest(table, path))
    return replace(data, notes=(*implausible_unit_sentences(data), *data.notes)), []


def _units(plan: GapPlan) -> dict[str, str]:
    """The unit of every column that the data can have, by name; for a table, as configured."""
    if plan.model is None:
        return {name: column.unit for name, column in plan.columns.items()}
    outputs = {output.name: output.unit for output in plan.model.outputs}
    stds = {f"{name}_std": unit for name, unit in outputs.items()}
    columns = {column.name: column.unit for column in (TIME, REPEAT, *plan.model.columns)}
    return {SESSION: "", plan.blocks: ""} | columns | stds | outputs


def _unused(plan: GapPlan, cells: pd.DataFrame, ignored: Sequence[str], known: Sequence[str]) -> list[str]:
    """Columns of the file without a role, except those whose name may be a misspelt one."""
    missing = [] if plan.model is None else [name for name in known if name not in cells]
    without_role = [str(name) for name in cells.columns if name not in {*ignored, *known}]
    return [name for name in without_role if not nearest(name, missing)]


def _digest(table: tables.Table, path: Path | None) -> str:
    """SHA-256 of a file, or of the cells of a table that has no file."""
    if path is None:
        return hashlib.sha256(table.cells.to_csv(index=False).encode()).hexdigest()
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _block_faults(plan: GapPlan, cells: pd.DataFrame, frame: pd.DataFrame, place: str) -> list[Fault]:
    """Faults of a validation column that is missing or holds a single label."""
    name, key = plan.blocks, "validation.blocks"
    if name == "auto":
        return []
    if name not in cells:
        close = nearest(name, map(str, cells.columns))
        return [Fault(key, f'{place} has no column "{name}"{close}; state one of its columns, or "auto"')]
    if name in frame and len(frame) and len(set(frame[name])) == 1:
        text = f"{name} is the same in every row of {place}: there is nothing to hold out"
        return [Fault(key, f'{text}; state another column, or "auto"')]
    return []


def _layout(
    plan: GapPlan, cells: pd.DataFrame
) -> tuple[tuple[Column, ...], tuple[Output, ...], dict[str, str], dict[str, str]]:
    """Input columns, outputs, and the columns of predictions and of known noise by output."""
    if plan.model is not None:
        outputs = tuple(o for o in plan.model.outputs if o.name in cells)
        stds = {o.name: f"{o.name}_std" for o in outputs if f"{o.name}_std" in cells}
        return (*plan.model.columns, TIME, REPEAT), outputs, {}, stds
    roles = plan.columns
    outputs = tuple(Output(n, c.unit, "measured") for n, c in roles.items() if c.role == "measured")
    inputs = tuple(
        Column(name, c.unit, c.role, True, c.role in ("unit", "lot"), Role(c.role), c.sense)
        for name, c in roles.items()
        if c.role not in ("measured", "predicted", "std", "ignore")
    )
    given_roles = {c.role for c in inputs}
    inputs += tuple(c for c in (TIME, REPEAT) if c.role not in given_roles and c.name not in roles)
    by = {
        role: {str(output_of(n, roles)): n for n, c in roles.items() if c.role == role} for role in ("predicted", "std")
    }
    unlisted = {o.name: f"{o.name}_std" for o in outputs if f"{o.name}_std" not in roles}
    stds = {name: std for name, std in unlisted.items() if std in cells} | by["std"]
    return inputs, outputs, by["predicted"], stds


def _missing_outputs(plan: GapPlan, cells: pd.DataFrame, outputs: tuple[Output, ...], place: str) -> list[Fault]:
    """Faults of measured columns that are missing."""
    if plan.model is None:
        return [Fault(place, f"column {o.name} is missing") for o in outputs if o.name not in cells]
    names = ", ".join(o.name for o in plan.model.outputs)
    return [] if outputs else [Fault(place, f"contains none of the measured outputs: {names}")]


def _drop_bad_rows(
    plan: GapPlan, frame: pd.DataFrame, faults: list[Fault], place: str, notes: list[str]
) -> tuple[pd.DataFrame, list[Fault]]:
    """Rows with a cell that is no finite number: faults, or dropped where the plan states it."""
    other_faults = [fault for fault in faults if fault.place == place]  # of the table, not of a cell
    if len(other_faults) == len(faults):
        return frame, faults
    if not plan.drop_bad_rows:
        return frame, [*faults, Fault("data.drop_bad_rows", "set it to true to drop these rows")]
    bad = frame.isna().any(axis=1) | (frame == "").any(axis=1)
    rows = abbreviated_list(str(at) for at in frame.index[bad])
    notes.append(f"{int(bad.sum())} rows with a cell that is no finite number were dropped, as requested: rows {rows}")
    return frame[~bad], other_faults


def _content_faults(
    plan: GapPlan,
    frame: pd.DataFrame,
    columns: tuple[Column, ...],
    outputs: tuple[Output, ...],
    predictions: Mapping[str, str],
    stds: Mapping[str, str],
    place: str,
) -> list[Fault]:
    """Faults of the values in the table."""
    faults = []
    count = len(plan.free) + len(outputs)
    if len(frame) < (least := max(MIN_UNITS, 2 * (1 + count))):
        text = f"has {len(frame)} rows; {count} free parameters of the model and the noise need at least {least}"
        faults.append(Fault(place, text))
    for column in columns:
        if column.role is Role.DIRECTION and column.name in frame:
            bad = ~frame[column.name].isin([-1.0, 1.0]) & frame[column.name].notna()
            faults += _cells(frame, column.name, bad, place, NO_DIRECTION)
    for name in stds.values():
        if name in frame:
            faults += _cells(frame, name, frame[name] <= 0.0, place, NO_NOISE)
    faults += _range_faults(plan, frame, columns, place)
    for output in outputs:
        if output.name in frame:
            faults += _measured_faults(frame, output.name, predictions.get(output.name), place)
    if not faults and not _varies(plan, frame, columns):
        faults.append(Fault(place, NO_VARIATION))
    return faults


def _varies(plan: GapPlan, frame: pd.DataFrame, columns: tuple[Column, ...]) -> bool:
    """Whether an input varies over the rows, or the rows are units of a population."""
    if plan.model is not None and plan.model.population:
        return True
    numbers = [c.name for c in columns if not c.text and c.role is not Role.REPEAT]
    return any((frame[name] != frame[name].iloc[0]).any() for name in numbers if name in frame)


def _range_faults(plan: GapPlan, frame: pd.DataFrame, columns: tuple[Column, ...], place: str) -> list[Fault]:
    """Faults of cells outside the physical range or the range of the model."""
    faults = []
    for column in columns:
        if column.role is Role.TEMPERATURE and column.name in frame:
            cold = frame[column.name] < converted(ABSOLUTE_ZERO, "degC", column.unit)
            faults += _cells(frame, column.name, cold, place, "is below absolute zero")
    if plan.model is None or any(c.needed and c.name not in frame for c in columns):
        return faults
    table = {c.name: frame[c.name].to_numpy() for c in columns if c.name in frame}
    for name, (wrong, text) in plan.model.outside(table).items():
        message = f"{text}: the model does not reach this pose; remove the row"
        faults += _cells(frame, name, pd.Series(wrong, index=frame.index), place, message)
    return faults


def _cells(frame: pd.DataFrame, column: str, bad: pd.Series[bool], place: str, text: str) -> list[Fault]:
    """The same fault for some cells of a column."""
    return tables.cell_faults(place, column, dict.fromkeys(frame.index[bad], text))


def _measured_faults(frame: pd.DataFrame, name: str, prediction: str | None, place: str) -> list[Fault]:
    """Faults of a measurement that never changes, or that the prediction copies."""
    faults = _cells(frame, name, frame[name].abs() > MAX_MEASURABLE, place, "is beyond all measurable values")
    values = frame[name].dropna().to_numpy()
    if len(values) > 1 and np.ptp(values) <= VARIATION_TOLERANCE * np.abs(values).max():
        faults.append(Fault(f"{place}: column {name}", "is the same in every row: nothing was measured"))
    if prediction in frame:
        both = frame[[name, prediction]].dropna()
        residual = (both[name] - both[prediction]).to_numpy()
        moved = len(both) > 1 and np.ptp(residual) <= VARIATION_TOLERANCE * np.abs(values).max()
        if moved or (len(both) and alike(both[name], both[prediction])):
            text = f"is a copy of {name}: a prediction comes from the simulation, not from the data"
            faults.append(Fault(f"{place}: column {prediction}", text))
    return faults


def finite_faults(predicted: Mapping[str, Any], rows: Any, place: str = "data") -> list[Fault]:
    """Faults of rows where the model has no finite prediction: they are outside its range."""
    faults = []
    for name, values in predicted.items():
        bad = [int(row) for row in rows[~np.isfinite(values)]]
        faults += tables.cell_faults(place, name, dict.fromkeys(bad, NO_PREDICTION))
    return faults
