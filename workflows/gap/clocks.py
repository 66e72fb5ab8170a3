"""The clock of a table, or of each of its sessions: rows in the order of measuring."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...errors import Fault
from ...models.effects.measurements import SESSION, own_clocks
from ...models.measurable import Column, Role

LATE = 0.05
"""Fraction of its span by which the start of a clock may differ from 0."""
FEW = 0.02
"""Fraction of a session's rows up to which a clock that goes back was reset; above it the rows are
in disorder."""


def in_time(frame: pd.DataFrame, columns: Sequence[Column], notes: list[str]) -> pd.DataFrame:
    """The rows in the order of measuring: by the clock, or by session where each has a clock."""
    time = clock_of(columns, frame)
    if time is None:
        return frame
    separate_clocks = SESSION in frame and own_clocks(frame[SESSION].to_numpy(), frame[time].to_numpy(dtype=float))
    steps = _steps(frame, time, separate_clocks)
    if count := int((steps < 0).sum()):
        notes.append(f"{time} goes back {count} times; the rows were put in the order of {time}")
        frame = _sorted(frame, time, separate_clocks)
        steps = _steps(frame, time, separate_clocks)
    if separate_clocks:
        notes.append(
            f"{time} starts again in each {SESSION}: rows are in the order of the sessions "
            "in the file, and effects of time refer to the start of their session"
        )
    if same := int((steps == 0).sum()):
        notes.append(f"{time} does not advance at {same} rows: their order is that of the file")
    usual = float(np.median(steps)) if len(steps) else 0.0
    if usual > 0 and (gaps := int((steps > 10 * usual).sum())):
        notes.append(f"{time} is broken by {gaps} gaps of more than 10 usual steps")
    return frame


def clock_of(columns: Sequence[Column], frame: pd.DataFrame) -> str | None:
    """The column of the time, None where there is none."""
    return next((c.name for c in columns if c.role is Role.TIME and c.name in frame), None)


def late(frame: pd.DataFrame, columns: Sequence[Column]) -> list[str]:
    """Messages about clocks that do not begin near 0, from where effects count the time."""
    clocks = [(c, frame[c.name].to_numpy(dtype=float)) for c in columns if c.role is Role.TIME and c.name in frame]
    return [
        f"{c.name} begins at {t.min():g} {c.unit}: wear and creep are counted from 0; subtract the value at the start"
        for c, t in clocks
        if abs(t.min()) > LATE * np.ptp(t)
    ]


def clock_faults(frame: pd.DataFrame, columns: Sequence[Column], place: str) -> list[Fault]:
    """Sessions in which the clock was reset: they have two clocks, whose order is unknown."""
    time = clock_of(columns, frame)
    if time is None or SESSION not in frame:
        return []
    faults = []
    for label, part in frame.groupby(SESSION, sort=False):
        t = part[time].to_numpy(dtype=float)
        back = np.flatnonzero(np.diff(t) < 0.0) + 1
        if 0 < len(back) <= max(1.0, FEW * len(t)):
            rows = ", ".join(str(part.index[at]) for at in back[:5])
            text = (
                f"is set back within {SESSION} {label}, at row {rows}: a session has one clock; give the "
                f"rows that follow a separate {SESSION}, or use one time for the whole record"
            )
            faults.append(Fault(f"{place}: column {time}", text))
    return faults


def _steps(frame: pd.DataFrame, time: str, separate_clocks: bool) -> NDArray[Any]:
    """Steps of the clock from row to row, within sessions where each has its own."""
    steps = np.diff(frame[time].to_numpy(dtype=float))
    if not separate_clocks:
        return steps
    label = frame[SESSION].to_numpy()
    return np.asarray(steps[label[1:] == label[:-1]])


def _sorted(frame: pd.DataFrame, time: str, separate_clocks: bool) -> pd.DataFrame:
    if not separate_clocks:
        return frame.sort_values(time, kind="stable")
    number = pd.Series(pd.factorize(frame[SESSION])[0], index=frame.index)
    return frame.assign(_number=number).sort_values(["_number", time], kind="stable").drop(columns="_number")
