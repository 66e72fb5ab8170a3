"""The tables of an arm, as `reading` reads them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...declarations import Value
from ...models.costs.reading import curve_table
from ...models.serial_arm import declared
from ...models.serial_arm.cell import Cell
from ...units import MM
from .definition import Definition, Gearing, Joint, LinkError


def definition_tables(definition: Definition, parameters: Mapping[str, Value]) -> dict[str, Any]:
    """`[[joint]]`, `[base]`, `[tool]`, `[cell]`, and the other parameters."""
    rows = [_joint(parameters, at, joint) for at, joint in enumerate(definition.joints, 1)]
    frames = {stem: _frame(stem, axes, parameters) for stem, axes in (("base", declared.BASE), ("tool", declared.TOOL))}
    remaining = {
        name: value for name, value in parameters.items() if not name.startswith("nominal_") and name != "joints"
    }
    return {"parameters": remaining, "joint": rows, **frames, "cell": _cell(definition.cell)}


def _joint(parameters: Mapping[str, Value], at: int, joint: Joint) -> dict[str, Any]:
    table: dict[str, Any] = {
        f"{column}_{unit}": parameters[declared.nominal(column, at)] for column, (unit, _) in declared.TABLE.items()
    }
    if joint.mass is not None:
        table |= {"mass_kg": joint.mass, "centre_of_mass_mm": _scaled(joint.centre, MM)}
    table["range_deg"] = _scaled((joint.low, joint.high), declared.DEG)
    table["reducer"] = "none" if joint.gearing is None else _gearing(joint.gearing)
    return table | {f"{kind}_{declared.ERRORS[kind][0]}": _error(error) for kind, error in joint.errors}


def _gearing(gearing: Gearing) -> dict[str, Any]:
    numbers = {
        "te_factor": gearing.te_factor,
        "stiffness_Nm_per_arcmin": gearing.stiffness,
        "friction_torque_Nm": gearing.friction,
    }
    words = {"flank": gearing.flank, "group": gearing.group}
    return {
        "run": dict(gearing.reducer.tables),
        "cost_factor": gearing.cost_factor,
        "backlash_factor": gearing.backlash_factor,
        **{key: value for key, value in numbers.items() if value is not None},
        **{key: value for key, value in words.items() if value},
    }


def _error(error: LinkError | None) -> dict[str, Any] | str:
    if error is None:
        return "none"
    return {"low": error.low, "high": error.high, "cost": curve_table(error.curve)}


def _frame(stem: str, axes: tuple[str, ...], parameters: Mapping[str, Value]) -> dict[str, Any]:
    units = {axis: "deg" if axis[0] == "r" else "mm" for axis in axes}
    return {f"{axis}_{unit}": parameters[f"nominal_{stem}_{axis}_{unit}"] for axis, unit in units.items()}


def _cell(cell: Cell) -> dict[str, Any]:
    table: dict[str, Any] = {"at": "tool" if cell.of_tool else "flange", "turn_deg": _scaled(cell.turn, declared.DEG)}
    if cell.near:
        table["near_deg"] = _scaled(cell.near, declared.DEG)
    if not cell.listed:
        return table | {
            "centre_mm": _scaled(cell.centre, MM),
            "side_mm": cell.side / MM,
            "poses": cell.kind,
            "per_edge": cell.per_edge,
        }
    key = "joints_deg" if cell.in_joints else "poses"
    return table | {key: [_row(row, cell.in_joints) for row in cell.listed]}


def _row(row: tuple[float, ...], in_joints: bool) -> list[float]:
    if in_joints:
        return _scaled(row, declared.DEG)
    return [*_scaled(row[:3], MM), *_scaled(row[3:], declared.DEG)]


def _scaled(values: tuple[float, ...], unit: float) -> list[float]:
    """Numbers in a unit, without the last digits of the division, so that they read back alike."""
    return [float(f"{value:.15g}") for value in (np.array(values) / unit).tolist()]
