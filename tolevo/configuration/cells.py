"""Poses of an arm from a table (`[cell]`), names with a dot as keys, and what the columns of files are
(`[columns]`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .. import tables
from ..commands.gap.plan import ROLES
from ..errors import nearest, raise_all, refuse
from ..models.measurable import Role
from ..models.serial_arm import MAX_JOINTS
from ..section import Section, Variable, shown
from ..units import fits
from .plugins import ModelClass, ProblemClass, sign_of

PLACE = {"x_mm": "mm", "y_mm": "mm", "z_mm": "mm"}
TURN = {"rx_deg": "deg", "ry_deg": "deg", "rz_deg": "deg"}
JOINTS = {f"joint_{at}_deg": "deg" for at in range(1, MAX_JOINTS + 1)}


def fill_poses(top: Section, problem_class: ProblemClass | None, folder: Path) -> Section:
    """The configuration with the rows of the file in the place of its name, where a problem has a
    `[cell]`; a faulty one stays.
    """
    tables = problem_class.declaration.tables if problem_class else ()
    cell = top.take("cell") if "cell" in tables else None
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


# Names with a dot, `gap.variation`, as keys: quoted, or in a table of their own.


class Nested:
    """A section in which `gap.variation` may be `"gap.variation"`, or `variation` of `[gap]`; so at any depth."""

    def __init__(self, section: Section, names: Iterable[str]) -> None:
        self._section = section
        inner: dict[str, list[str]] = {}
        for head, dot, rest in (name.partition(".") for name in names):
            inner.setdefault(head, []).extend([rest] if dot else [])
        self._tables = {
            head: Nested(section.section(head), rests)
            for head, rests in inner.items()
            if rests and isinstance(section.take(head), Mapping)
        }

    def find(self, name: str) -> tuple[Section, str]:
        """The section in which a name is a key, and the key."""
        head, _, rest = name.partition(".")
        if not rest or head not in self._tables:
            return self._section, name
        table, key = self._tables[head].find(rest)
        if name in self._section and key in table:
            self._section.take(name)
            self._section.fault(name, f'is given twice: as "{name}" and in [{head}]')
        return (self._section, name) if name in self._section else (table, key)

    def finish(self) -> None:
        """Report every key that was not asked for."""
        for table in self._tables.values():
            table.finish()
        self._section.finish()


def nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by dotted name as tables of tables."""
    nested_values: dict[str, Any] = {}
    for name, value in values.items():
        head, _, rest = name.partition(".")
        if rest:
            nested_values.setdefault(head, {})[rest] = value
        else:
            nested_values[name] = value
    return nested_values


# `[columns]`: which column of a model or problem a column of a file is, whatever its name.


ALWAYS = {Role.TIME: ("time_s", "s"), Role.REPEAT: ("repeat", "")}
"""Columns that a table of any model may have: name and unit."""
VARIABLE = "variable"
"""The role of a column of a table of designs."""


def read_model_columns(top: Section, kind: ModelClass) -> dict[str, tables.ColumnUse]:
    """What each listed column of a file of measurements or operating points is.

    A column is given by the name that the model has for it (`"Spiel" = "backlash_arcmin"`), or by a
    table of its role and unit, and `of` where the model has several columns of that role.
    """
    return _read_column(top, _allowed_columns(kind))


def read_design_columns(top: Section, variables: Iterable[Variable]) -> dict[str, tables.ColumnUse]:
    """What each listed column of a table of designs is: a variable by its name
    (`"Bohrung" = "bore_t"`), or by `{ of = "bore_t", unit = "um" }`.
    """
    return _read_column(top, {variable.name: (VARIABLE, variable.unit) for variable in variables})


def _read_column(top: Section, known: Mapping[str, tuple[str, str]]) -> dict[str, tables.ColumnUse]:
    section = top.section("columns")
    uses: dict[str, tables.ColumnUse] = {}
    for key in section.all_keys():
        stated = section.take(key)
        if isinstance(stated, str):
            use = _column_by_name(section, key, stated, known)
        elif isinstance(stated, Mapping):
            use = _column_by_role(section.section(key), known)
        else:
            text = f'must be a name of a column {_owner(known)} or {{ role = "..." }}'
            section.fault(key, f"{text}, got {shown(stated)}")
            use = None
        if use is not None:
            uses[key] = use
    return uses


def resolved_columns(uses: Mapping[str, tables.ColumnUse]) -> dict[str, Any]:
    """The `[columns]` table."""
    written = {key: {"role": "ignore"} if not use.target else _column_entry(use) for key, use in uses.items()}
    return {"columns": written} if written else {}


def _column_entry(use: tables.ColumnUse) -> dict[str, Any]:
    sense = {"sense": use.sense} if use.sense != 1 else {}
    return {"of": use.target, **({"unit": use.unit} if use.unit else {}), **sense}


def _allowed_columns(kind: ModelClass) -> dict[str, tuple[str, str]]:
    """Role and unit of every column that the model can take, by name."""
    columns = {name: (role.value, unit) for role, (name, unit) in ALWAYS.items()}
    columns |= {f"{output.name}_std": ("std", output.unit) for output in kind.outputs}
    columns |= {output.name: ("measured", output.unit) for output in kind.outputs}
    return columns | {column.name: (column.role.value, column.unit) for column in kind.columns}


def _column_by_name(
    section: Section, key: str, name: str, known: Mapping[str, tuple[str, str]]
) -> tables.ColumnUse | None:
    """A column by its name."""
    if name == "ignore":
        return tables.ColumnUse("")
    if name not in known:
        text = f'"{name}" is not a column {_owner(known)}{nearest(name, known)}'
        section.fault(key, f"{text}; it has {', '.join(known)}")
        return None
    return tables.ColumnUse(name)


def _owner(known: Mapping[str, tuple[str, str]]) -> str:
    return "of the problem" if all(role == VARIABLE for role, _ in known.values()) else "of the model"


def _column_by_role(section: Section, known: Mapping[str, tuple[str, str]]) -> tables.ColumnUse | None:
    """A column by its role."""
    role, unit = section.text("role", ROLES), section.text("unit") or ""
    of, sense = section.text("of") or "", sign_of(section, "sense") or 1
    section.finish()
    if role == "ignore":
        return tables.ColumnUse("")
    if role is None and not of:
        return None  # without a role it is not used, and a note says so
    if role == "std" and f"{of}_std" in known:
        of = f"{of}_std"
    fitting = [name for name, (column_role, _) in known.items() if role in (None, column_role)]
    if of and of not in fitting:
        text = f'"{of}" is not a column {_owner(known)} with this role{nearest(of, fitting)}'
        section.fault("of", f"{text}; it has {', '.join(fitting) or 'none'}")
        return None
    if not of and len(fitting) != 1:
        text = f"several columns {_owner(known)} have this role: state one of them by `of`: {', '.join(fitting)}"
        section.fault("role", text if fitting else f'no column {_owner(known)} has the role "{role}"')
        return None
    target = of or fitting[0]
    return tables.ColumnUse(target, unit, sense) if _unit_fits(section, unit, known[target][1]) else None


def _unit_fits(section: Section, unit: str, wanted: str) -> bool:
    """Whether a unit can be stated in that of the model's column."""
    try:
        if not unit or not wanted or fits(unit, wanted):
            return True
        section.fault("unit", f'"{unit}" cannot be stated in {wanted}')
    except ValueError as error:
        section.fault("unit", str(error))
    return False
