"""Batches as units: repeated measurements of a unit are merged, and units are counted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from ...errors import Fault
from ...models.measurable import Column, Role

SEVERAL = 3
"""Least number of units of a model of single units, each perhaps under several conditions."""
LEAST = 12
"""Rows, or units of a batch, below which nothing is distinguishable from noise."""


def numbered(cells: pd.DataFrame, columns: Sequence[Column], place: str, notes: list[str]) -> pd.DataFrame:
    """The cells with a number for each unit. Labels such as RG20-1203 are numbered in their order
    unless the model takes names; without a column of units every row is a unit.
    """
    unit = next((c for c in columns if c.role is Role.UNIT), None)
    if unit is None or not len(cells):
        return cells
    name = unit.name
    if name not in cells:
        notes.append(f"{place}: no column {name}: each row counts as a separate unit")
        number = np.arange(1, len(cells) + 1)
        return cells.assign(**{name: number.astype(str) if unit.text else number})
    if unit.text:
        return cells
    labels = cells[name].astype(object)
    filled = labels[labels.notna() & (labels.astype(str) != "")]
    if pd.to_numeric(filled, errors="coerce").notna().all():
        return cells
    number, names = pd.factorize(filled)
    notes.append(f"{place}: {len(names)} labels of units ({names[0]}, ...) are numbered in the order of the rows")
    return cells.assign(**{name: pd.Series(number + 1, index=filled.index).reindex(cells.index)})


def one_per_unit(
    frame: pd.DataFrame, columns: Sequence[Column], place: str, notes: list[str]
) -> tuple[pd.DataFrame, list[Fault]]:
    """The table with one row per unit, the mean of its repeats; a fault where units are too few.

    Units are distinguished by the columns of unit and lot. A row keeps the line number of the
    unit's first measurement. Without a column of repeats every row is a unit.
    """
    labels = [c.name for c in columns if c.role in (Role.UNIT, Role.LOT) and c.name in frame]
    if not labels:
        return frame, []
    if faults := _several_per_unit(frame, columns, place):
        return frame, faults
    number = frame.groupby(labels, sort=False, dropna=False).ngroup().to_numpy()
    units, rows = len(np.unique(number)), len(frame)
    if units < LEAST:
        text = f"holds {units} units in {rows} rows: cannot tell with n = {units}; a batch needs at least {LEAST} units"
        return frame, [Fault(place, text)]
    repeat = next((c.name for c in columns if c.role is Role.REPEAT and c.name in frame), None)
    if units < rows and repeat is None:
        notes.append(
            f"{rows - units} rows repeat the label of a unit: each counts as a separate unit; a "
            "column repeat states that a unit was measured again"
        )
    if repeat is None:
        return frame, []
    if units < rows:
        notes.append(f"{rows} measurements of {units} units: each unit is the mean of its measurements")
    merged = frame.drop(columns=repeat).groupby(number, sort=True)
    means = merged.agg({name: "first" if name in labels else "mean" for name in frame.columns if name != repeat})
    return means.set_axis(frame.index[~pd.Series(number).duplicated().to_numpy()]), []


def _several_per_unit(frame: pd.DataFrame, columns: Sequence[Column], place: str) -> list[Fault]:
    """Faults of columns that make a row one of many measurements of a unit, which have no law."""
    text = (
        "a batch is compared by one measurement of each unit: give the largest (or the mean) of its "
        "measurements, set [parameters] positions to their number, and remove this column"
    )
    inputs = (c.name for c in columns if of_one_measurement(c) and c.name in frame)
    return [Fault(f"{place}: column {name}", text) for name in inputs]


def of_one_measurement(column: Column) -> bool:
    """Whether a column distinguishes measurements of a unit, so that a batch must not have it."""
    return column.role is Role.INPUT


def too_few(frame: pd.DataFrame, columns: Sequence[Column], place: str) -> list[Fault]:
    """A fault where a model that needs the units' labels has only one or two units."""
    name = next((c.name for c in columns if c.role is Role.UNIT and c.needed), None)
    if name is None or name not in frame or frame.empty:
        return []
    units = frame[name].nunique()
    text = f"holds {units} units in {len(frame)} rows: cannot tell with n = {units}; give at least {SEVERAL} units"
    return [Fault(place, text)] if units < SEVERAL else []
