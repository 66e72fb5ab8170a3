"""Poses of an arm from a table (`[cell]`)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .. import tables
from ..errors import raise_all, refuse
from ..models.serial_arm import MAX_JOINTS
from ..section import Section

PLACE = {"x_mm": "mm", "y_mm": "mm", "z_mm": "mm"}
TURN = {"rx_deg": "deg", "ry_deg": "deg", "rz_deg": "deg"}
JOINTS = {f"joint_{at}_deg": "deg" for at in range(1, MAX_JOINTS + 1)}


def fill_poses(top: Section, folder: Path) -> Section:
    """The configuration with the rows of the file that `[cell]` names in the place of its name; a faulty one
    stays.
    """
    cell = top.take("cell")
    name = cell.get("poses") if isinstance(cell, Mapping) else None
    if cell is None or not isinstance(name, str) or "." not in name:
        return top
    read = top.section("cell").attempt(
        partial(_read, folder / name, name), lambda fault: ("poses", f"{fault.place} {fault.message}")
    )
    if read is None:
        return top
    return top.having("cell", {k: v for k, v in cell.items() if k != "poses"} | {read[0]: read[1]})


def _read(path: Path, name: str) -> tuple[str, list[list[float]]]:
    """`poses` or `joints_deg`, and the rows. Raises InputError."""
    fit = tables.fit_columns(tables.open_or_raise(path, name, tables.NO_OPTIONS), name, PLACE | TURN | JOINTS)
    raise_all(list(fit.faults))
    cells = fit.cells
    joints = [joint for joint in JOINTS if joint in cells]
    turned = [angle for angle in TURN if angle in cells]
    if joints and not any(coordinate in cells for coordinate in PLACE):
        return "joints_deg", _numbers(cells[joints], name)
    wanted = [*PLACE, *(TURN if turned else ())]
    if missing := [column for column in wanted if column not in cells]:
        poses = "x_mm, y_mm, z_mm, with or without rx_deg, ry_deg, rz_deg, or joint_1_deg, joint_2_deg, ..."
        raise refuse(name, f"lacks {', '.join(missing)}: the columns of poses are {poses}")
    return "poses", _numbers(cells[wanted], name)


def _numbers(cells: Any, name: str) -> list[list[float]]:
    try:
        rows = cells.to_numpy(dtype=float)
    except (TypeError, ValueError) as error:
        raise refuse(name, f"must hold numbers: {error}") from None
    if len(rows) == 0:
        raise refuse(name, "has no rows")
    if not (finite := np.all(np.isfinite(rows), axis=1)).all():
        raise refuse(name, f"row {int(np.argmin(finite)) + 1} has an empty or infinite cell")
    return [[float(number) for number in row] for row in rows]
