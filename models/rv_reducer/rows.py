"""Rows of a measurement table of a loaded unit, checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...errors import Fault, raise_all
from ..measurable import Outside

SPEED = "must be above 0 (omit the column for quasi-static measurements; the sense of turning is `direction`)"


@dataclass(frozen=True, slots=True)
class Rows:
    """Columns (n,) of a table in SI; `speed` and `direction` are None where the table has none.

    `angle` [rad] and `torque` [N m] are zero where the table has none, `speed` is in rad/s,
    `direction` is +1 or -1; `angled` is true where the table has angles.
    """

    angle: Array
    torque: Array
    speed: Array | None
    direction: Array | None
    angled: bool

    def __len__(self) -> int:
        return len(self.angle)

    @classmethod
    def of(cls, table: Mapping[str, NDArray[Any]]) -> Rows:
        """The rows of a table. Raises InputError with every fault of its numbers."""
        names = ("output_angle_deg", "torque_Nm", "output_speed_rpm", "direction")
        columns = {n: np.asarray(table[n], dtype=float) for n in names if n in table}
        raise_all(_faults(columns))
        count = len(next(iter(table.values()))) if table else 0
        speed = columns.get("output_speed_rpm")
        return cls(
            angle=np.radians(columns.get("output_angle_deg", np.zeros(count))),
            torque=columns.get("torque_Nm", np.zeros(count)),
            speed=None if speed is None else speed * (2.0 * np.pi / 60.0),
            direction=columns.get("direction"),
            angled="output_angle_deg" in columns,
        )


def _faults(columns: Mapping[str, Array]) -> list[Fault]:
    faults = []
    for name, column in columns.items():
        wrong = ~np.isfinite(column)
        text = "must be finite"
        if name == "output_speed_rpm":
            wrong, text = wrong | (column <= 0.0), SPEED
        if name == "direction":
            wrong, text = wrong | (np.abs(column) != 1.0), "must be 1 or -1"
        if wrong.any():
            row = int(np.argmax(wrong))
            faults.append(Fault(f"{name}, row {row + 1}", f"{text}, got {column[row]:g}"))
    return faults


def outside(table: Mapping[str, NDArray[Any]], momentary: float) -> Outside:
    """Torques [N m] beyond the momentary one, and speeds that are not positive."""
    rows: dict[str, tuple[NDArray[np.bool_], str]] = {}
    if "torque_Nm" in table:
        wrong = np.abs(np.asarray(table["torque_Nm"], dtype=float)) > momentary
        text = f"is beyond the momentary torque of the reducer, {momentary:g} N m"
        rows["torque_Nm"] = wrong, text
    if "output_speed_rpm" in table:
        wrong = np.asarray(table["output_speed_rpm"], dtype=float) <= 0.0
        rows["output_speed_rpm"] = wrong, SPEED
    return rows
