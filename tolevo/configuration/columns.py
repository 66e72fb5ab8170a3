"""What the columns of files are (`[columns]`): role and unit in a table of a model of one's own, or the
column of a model or problem that each one is.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from .. import tables
from ..errors import nearest
from ..models.measurable import Role
from ..section import Section, Variable, shown
from ..units import dimension, fits
from .plugins import ModelClass, sign_of

ROLES = (*map(str, Role), "measured", "predicted", "std", "ignore")
"""The roles that `[columns]` gives."""
ROLE_UNITS = {
    "angle": ("rad", "m"),
    "torque": ("N m",),
    "force": ("N",),
    "speed": ("rpm", "m/s"),
    "temperature": ("degC",),
    "time": ("s",),
    "payload": ("kg",),
    "position": ("m",),
}
"""The units of a column of a role in effects; the second is that of linear motion."""


@dataclass(frozen=True, slots=True)
class ColumnRole:
    """Role and unit of a column of a table; `of` is the output of a prediction or noise.

    `sense` is -1 where its sign is opposite to the convention (docs/conventions.md).
    """

    role: str
    unit: str = ""
    of: str = ""
    sense: int = 1


def output_of(name: str, columns: Mapping[str, ColumnRole]) -> str | None:
    """The measured column that a predicted or std column belongs to, None where it is not clear."""
    measured = [n for n, column in columns.items() if column.role == "measured"]
    if of := columns[name].of:
        return of if of in measured else None
    stem = name.removesuffix(f"_{columns[name].role}")
    if stem in measured:
        return stem
    return measured[0] if len(measured) == 1 else None


PLAIN = ("unit", "lot", "repeat", "direction", "ignore")
"""Roles without a unit: labels, signs and counts."""
UNSIGNED = ("unit", "lot", "repeat", "ignore", "std", "time", "temperature", "payload")
"""Roles of what has no opposite."""


def read_columns(top: Section) -> dict[str, ColumnRole]:
    """Role and unit by column."""
    section = top.section("columns")
    names = section.all_keys()
    columns = {name: _column(section.section(name)) for name in names}
    valid = {name: column for name, column in columns.items() if column is not None}
    without_role = [name for name in names if columns[name] is None and "role" not in section.section(name)]
    if not names:
        top.fault("columns", 'is missing: model = "table" needs role and unit of each column')
    elif len(valid) + len(without_role) == len(columns):
        _check(section, valid)
    return valid


def _column(section: Section) -> ColumnRole | None:
    role = section.text("role", ROLES)
    unit = section.text("unit") or ""
    of = section.text("of") or ""
    sense = sign_of(section, "sense") or 1
    section.finish()
    if role is None:  # at fault, or no role: the column is not used, and a note says so
        return None
    if sense < 0 and role in UNSIGNED:
        section.fault("sense", f"has no meaning: a column of role {role} has no sign")
    choices = ROLE_UNITS.get(role)
    try:
        if unit and choices and not any(fits(unit, choice) for choice in choices):
            listed = " or ".join(f'"{choice}"' for choice in choices)
            section.fault("unit", f'must be a unit of {role} such as {listed}, got "{unit}"')
        elif unit and role not in PLAIN:
            dimension(unit)
    except ValueError as error:
        section.fault("unit", str(error))
    if choices and not unit:
        section.fault("unit", f'is missing: a column of role {role} needs a unit, such as "{choices[0]}"')
    return ColumnRole(role, unit, of, sense)


def _check(section: Section, columns: dict[str, ColumnRole]) -> None:
    """Measured and predicted columns pair; single roles are given once."""
    by = {role: [n for n, c in columns.items() if c.role == role] for role in ROLES}
    if not by["measured"]:
        section.fault("", 'no column has the role "measured"')
    if not by["predicted"]:
        section.fault("", 'no column has the role "predicted"; without a model the table must contain the prediction')
    for role in ("direction", "time", "unit", "lot", "repeat"):
        if len(by[role]) > 1:
            section.fault("", f'the role "{role}" is given to {", ".join(by[role])}: only one column can have it')
    for role in ("predicted", "std"):
        for name in by[role]:
            output = output_of(name, columns)
            if output is None and by["measured"]:
                section.section(name).fault("of", f"is missing: name the measured column that {name} belongs to")
            elif output is not None and columns[output].unit and columns[name].unit:
                _check_prediction_unit(section, name, output, columns)


def _check_prediction_unit(section: Section, name: str, output: str, columns: dict[str, ColumnRole]) -> None:
    """A prediction is in a unit of the same dimension as its measurement."""
    unit, output_unit = columns[name].unit, columns[output].unit
    try:
        if not fits(unit, output_unit):
            section.section(name).fault("unit", f'"{unit}" does not fit {output}, which is in "{output_unit}"')
    except ValueError:
        return  # the unknown unit is reported where it stands


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
    return _read_uses(top, _allowed_columns(kind))


def read_design_columns(top: Section, variables: Iterable[Variable]) -> dict[str, tables.ColumnUse]:
    """What each listed column of a table of designs is: a variable by its name
    (`"Bohrung" = "bore_t"`), or by `{ of = "bore_t", unit = "um" }`.
    """
    return _read_uses(top, {variable.name: (VARIABLE, variable.unit) for variable in variables})


def _read_uses(top: Section, known: Mapping[str, tuple[str, str]]) -> dict[str, tables.ColumnUse]:
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
