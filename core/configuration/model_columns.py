"""`[columns]`: which column of a model or problem a column of a file is, whatever its name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ..declarations import Variable
from ..errors import nearest
from ..models.measurable import Role
from ..section import Section, shown
from ..tables import ColumnUse
from ..units import fits
from ..workflows.gap.plan import ROLES
from .plugins import ModelClass
from .senses import sign_of

ALWAYS = {Role.TIME: ("time_s", "s"), Role.REPEAT: ("repeat", "")}
"""Columns that a table of any model may have: name and unit."""
VARIABLE = "variable"
"""The role of a column of a table of designs."""


def read_model_columns(top: Section, kind: ModelClass) -> dict[str, ColumnUse]:
    """What each listed column of a file of measurements or operating points is.

    A column is given by the name that the model has for it (`"Spiel" = "backlash_arcmin"`), or by a
    table of its role and unit, and `of` where the model has several columns of that role.
    """
    return _read(top, _allowed_columns(kind))


def read_design_columns(top: Section, variables: Iterable[Variable]) -> dict[str, ColumnUse]:
    """What each listed column of a table of designs is: a variable by its name
    (`"Bohrung" = "bore_t"`), or by `{ of = "bore_t", unit = "um" }`.
    """
    return _read(top, {variable.name: (VARIABLE, variable.unit) for variable in variables})


def _read(top: Section, known: Mapping[str, tuple[str, str]]) -> dict[str, ColumnUse]:
    section = top.section("columns")
    uses: dict[str, ColumnUse] = {}
    for key in section.all_keys():
        stated = section.take(key)
        if isinstance(stated, str):
            use = _by_name(section, key, stated, known)
        elif isinstance(stated, Mapping):
            use = _by_role(section.section(key), known)
        else:
            text = f'must be a name of a column {_owner(known)} or {{ role = "..." }}'
            section.fault(key, f"{text}, got {shown(stated)}")
            use = None
        if use is not None:
            uses[key] = use
    return uses


def resolved_columns(uses: Mapping[str, ColumnUse]) -> dict[str, Any]:
    """The `[columns]` table."""
    written = {key: {"role": "ignore"} if not use.target else _written(use) for key, use in uses.items()}
    return {"columns": written} if written else {}


def _written(use: ColumnUse) -> dict[str, Any]:
    sense = {"sense": use.sense} if use.sense != 1 else {}
    return {"of": use.target, **({"unit": use.unit} if use.unit else {}), **sense}


def _allowed_columns(kind: ModelClass) -> dict[str, tuple[str, str]]:
    """Role and unit of every column that the model can take, by name."""
    columns = {name: (role.value, unit) for role, (name, unit) in ALWAYS.items()}
    columns |= {f"{output.name}_std": ("std", output.unit) for output in kind.outputs}
    columns |= {output.name: ("measured", output.unit) for output in kind.outputs}
    return columns | {column.name: (column.role.value, column.unit) for column in kind.columns}


def _by_name(section: Section, key: str, name: str, known: Mapping[str, tuple[str, str]]) -> ColumnUse | None:
    """A column by its name."""
    if name == "ignore":
        return ColumnUse("")
    if name not in known:
        text = f'"{name}" is not a column {_owner(known)}{nearest(name, known)}'
        section.fault(key, f"{text}; it has {', '.join(known)}")
        return None
    return ColumnUse(name)


def _owner(known: Mapping[str, tuple[str, str]]) -> str:
    return "of the problem" if all(role == VARIABLE for role, _ in known.values()) else "of the model"


def _by_role(section: Section, known: Mapping[str, tuple[str, str]]) -> ColumnUse | None:
    """A column by its role."""
    role, unit = section.text("role", ROLES), section.text("unit") or ""
    of, sense = section.text("of") or "", sign_of(section, "sense") or 1
    section.finish()
    if role == "ignore":
        return ColumnUse("")
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
    return ColumnUse(target, unit, sense) if _unit_fits(section, unit, known[target][1]) else None


def _unit_fits(section: Section, unit: str, wanted: str) -> bool:
    """Whether a unit can be stated in that of the model's column."""
    try:
        if not unit or not wanted or fits(unit, wanted):
            return True
        section.fault("unit", f'"{unit}" cannot be stated in {wanted}')
    except ValueError as error:
        section.fault("unit", str(error))
    return False
