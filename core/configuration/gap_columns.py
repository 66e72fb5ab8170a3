"""`[columns]` of a gap analysis of a table: role and unit of every column."""

from __future__ import annotations

from ..section import Section
from ..units import dimension, fits
from ..workflows.gap.plan import ROLE_UNITS, ROLES, ColumnRole, output_of
from .senses import sign_of

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
