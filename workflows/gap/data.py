"""The data of a gap analysis: a checked table in the order of measuring, and what its columns mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...declarations import Output
from ...models.effects import Readings, Target
from ...models.inputs.distribution import Array
from ...models.measurable import Column, Role
from ...units import factor
from .plan import ROLE_UNITS, GapPlan

LABELS = (Role.UNIT, Role.LOT)


@dataclass(frozen=True)
class GapData:
    """Rows (n,) in the order of measuring.

    `measured` holds each output (n,) in its unit, `predicted` the prediction that the table itself
    carries, `std` the noise that it states; `rows` are the line numbers in the file, `blocks` the
    labels of the column that the configuration validates by, `repeats` the label of equal inputs.
    """

    target: Target
    readings: Readings
    measured: Mapping[str, Array]
    predicted: Mapping[str, Array]
    std: Mapping[str, Array]
    rows: NDArray[np.int64]
    blocks: NDArray[Any] | None = None
    repeats: NDArray[Any] | None = None
    zeros: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def outputs(self) -> tuple[Output, ...]:
        """The outputs that were measured."""
        return self.target.outputs

    @property
    def inputs(self) -> tuple[Column, ...]:
        """The input columns that hold numbers and vary."""
        table = self.readings.table
        return tuple(
            c for c in self.target.columns if not c.text and np.ptp(np.asarray(table[c.name])) > 0
        )

    def some(self, rows: NDArray[np.int64]) -> GapData:
        """The same data at some of the rows."""
        from dataclasses import replace

        return replace(
            self,
            readings=Readings(
                {name: values[rows] for name, values in self.readings.table.items()},
                {role: values[rows] for role, values in self.readings.by_role.items()},
            ),
            measured={name: values[rows] for name, values in self.measured.items()},
            predicted={name: values[rows] for name, values in self.predicted.items()},
            std={name: values[rows] for name, values in self.std.items()},
            rows=self.rows[rows],
            blocks=None if self.blocks is None else self.blocks[rows],
            repeats=None if self.repeats is None else self.repeats[rows],
        )


def assembled(
    plan: GapPlan,
    frame: pd.DataFrame,
    columns: tuple[Column, ...],
    outputs: tuple[Output, ...],
    predictions: Mapping[str, str],
    stds: Mapping[str, str],
    notes: list[str],
) -> GapData:
    """The data from a typed, checked table.

    `predictions` and `stds` name the column of an output; both are brought to the output's unit.
    """
    frame = _in_time(frame, columns, notes)
    table = {c.name: frame[c.name].to_numpy() for c in columns}
    by_role = _by_role(columns, table)
    units = {o.name: o.unit for o in outputs}
    target = Target(
        model=plan.model_name,
        outputs=outputs,
        columns=columns,
        changeable=() if plan.model is None else plan.model.changeable,
        population=plan.model is not None and plan.model.population,
        several=len(outputs) > 1 if plan.model is None else len(plan.model.outputs) > 1,
        largest={role: float(np.abs(values).max()) for role, values in by_role.items()
                 if role not in (*LABELS, Role.REPEAT)},
        labels={role: tuple(dict.fromkeys(by_role[role].astype(str).tolist()))
                for role in LABELS if role in by_role},
        units={c.role: _base(c) for c in columns if not c.text},
    )  # fmt: skip
    return GapData(
        target=target,
        readings=Readings(table, by_role),
        measured={name: frame[name].to_numpy(dtype=float) for name in units},
        predicted={
            name: _converted(frame[column], _unit(plan, column, units[name]), units[name])
            for name, column in predictions.items()
        },
        std={
            name: _converted(frame[column], _unit(plan, column, units[name]), units[name], True)
            for name, column in stds.items()
        },
        rows=frame.index.to_numpy(),
        blocks=None if plan.blocks == "auto" else frame[plan.blocks].to_numpy(),
        repeats=_repeats(frame, columns),
        zeros=_zeros(plan, target),
        notes=tuple(notes),
    )


def _unit(plan: GapPlan, column: str, unit: str) -> str:
    given = plan.columns.get(column)
    return unit if given is None or not given.unit else given.unit


def _converted(values: pd.Series[Any], unit: str, wanted: str, scale_only: bool = False) -> Array:
    scale, offset = (1.0, 0.0) if unit == wanted else factor(unit, wanted)
    return values.to_numpy(dtype=float) * scale + (0.0 if scale_only else offset)


def _in_time(frame: pd.DataFrame, columns: tuple[Column, ...], notes: list[str]) -> pd.DataFrame:
    """The rows in the order of measuring."""
    time = next((c.name for c in columns if c.role is Role.TIME), None)
    if time is None:
        return frame
    steps = np.diff(frame[time].to_numpy())
    if (steps < 0).any():
        count = int((steps < 0).sum())
        notes.append(f"{time} goes back {count} times; the rows were put in the order of {time}")
        frame = frame.sort_values(time, kind="stable")
        steps = np.diff(frame[time].to_numpy())
    if same := int((steps == 0).sum()):
        notes.append(f"{time} stands still at {same} rows: their order is that of the file")
    usual = float(np.median(steps)) if len(steps) else 0.0
    if usual > 0 and (gaps := int((steps > 10 * usual).sum())):
        notes.append(f"{time} is broken by {gaps} gaps of more than 10 usual steps")
    return frame


def _by_role(
    columns: tuple[Column, ...], table: Mapping[str, NDArray[Any]]
) -> dict[Role, NDArray[Any]]:
    """The first column of each role, in the unit in which effects see it."""
    found: dict[Role, NDArray[Any]] = {}
    for column in columns:
        wanted = ROLE_UNITS.get(str(column.role))
        if column.role in found or column.role is Role.INPUT:
            continue
        values = table[column.name]
        if wanted is not None and not column.text:
            scale, offset = factor(column.unit, _base(column))
            values = np.asarray(values, dtype=float) * scale + offset
        found[column.role] = values
    return found


def _base(column: Column) -> str:
    """The unit in which effects see a column; what moves along a line has m and m/s."""
    wanted = ROLE_UNITS.get(str(column.role), column.unit)
    for unit in (wanted, "m", "m/s"):
        try:
            factor(column.unit, unit)
        except ValueError:
            continue
        return unit
    return column.unit


def _repeats(frame: pd.DataFrame, columns: tuple[Column, ...]) -> NDArray[Any] | None:
    """A label of equal inputs, where the table says that readings were repeated."""
    if not any(c.role is Role.REPEAT for c in columns):
        return None
    same = [c.name for c in columns if c.role not in (Role.TIME, Role.REPEAT)]
    return frame.groupby(same, sort=False, dropna=False).ngroup().to_numpy()


def _zeros(plan: GapPlan, target: Target) -> tuple[str, ...]:
    """The outputs whose zero is always free: angles, twists, transmission errors."""
    if target.population or (plan.model is not None and target.several):
        return ()
    return tuple(o.name for o in target.outputs if _is_angle(o.unit))


def _is_angle(unit: str) -> bool:
    try:
        factor(unit, "rad")
    except ValueError:
        return False
    return unit not in ("", "1")
