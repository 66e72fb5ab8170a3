"""`[columns]` of a model: which columns of a file are which of the model, whatever their names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..errors import nearest
from ..models.measurable import Role
from ..section import Section, shown
from ..tables import ColumnUse
from ..units import fits
from ..workflows.gap.plan import ROLES
from .sense import sign_of

ALWAYS = {Role.TIME: ("time_s", "s"), Role.REPEAT: ("repeat", "")}
"""Columns that a table of any model may have: name and unit."""
OUTPUTS = ("measured", "std")


def read_model_columns(top: Section, kind: Any) -> dict[str, ColumnUse]:
    """What each listed column of the file is.

    A column is given by the name that the model has for it (`"Spiel" = "backlash_arcmin"`), or by a
    table of its role and unit, and `of` where the model has several columns of that role.
    """
    section = top.section("columns")
    found: dict[str, ColumnUse] = {}
    for key in section.given():
        given = section.take(key)
        if isinstance(given, str):
            use = _named(section, key, given, kind)
        elif isinstance(given, Mapping):
            use = _described(section.section(key), kind)
        else:
            text = (
                f'must be a name of a column of the model or {{ role = "..." }}, got {shown(given)}'
            )
            section.fault(key, text)
            use = None
        if use is not None:
            found[key] = use
    return found


def resolved_columns(uses: Mapping[str, ColumnUse]) -> dict[str, Any]:
    """The `[columns]` table."""
    written = {
        key: {"role": "ignore"} if not use.target else _written(use) for key, use in uses.items()
    }
    return {"columns": written} if written else {}


def _written(use: ColumnUse) -> dict[str, Any]:
    sense = {"sense": use.sense} if use.sense != 1 else {}
    return {"of": use.target, **({"unit": use.unit} if use.unit else {}), **sense}


def _known(kind: Any) -> dict[str, tuple[str, str]]:
    """Role and unit of every column that the model can take, by name."""
    found = {name: (role.value, unit) for role, (name, unit) in ALWAYS.items()}
    found |= {f"{one.name}_std": ("std", one.unit) for one in kind.outputs}
    found |= {one.name: ("measured", one.unit) for one in kind.outputs}
    return found | {one.name: (one.role.value, one.unit) for one in kind.columns}


def _named(section: Section, key: str, name: str, kind: Any) -> ColumnUse | None:
    """A column by the model's name."""
    known = _known(kind)
    if name == "ignore":
        return ColumnUse("")
    if name not in known:
        listed = ", ".join(known)
        text = f'"{name}" is no column of the model{nearest(name, known)}; it has {listed}'
        section.fault(key, text)
        return None
    return ColumnUse(name)


def _described(section: Section, kind: Any) -> ColumnUse | None:
    """A column by its role."""
    role, unit = section.text("role", ROLES), section.text("unit") or ""
    of, sense = section.text("of") or "", sign_of(section, "sense") or 1
    section.finish()
    if role == "ignore":
        return ColumnUse("")
    if role is None and not of:
        return None  # without a role it is of no use, and said in a note
    known = _known(kind)
    if role == "std" and f"{of}_std" in known:
        of = f"{of}_std"
    fitting = [name for name, (own, _) in known.items() if own == role or (role is None)]
    if of and of not in fitting:
        text = f'"{of}" is no column of the model with this role{nearest(of, fitting)}'
        section.fault("of", f"{text}; it has {', '.join(fitting) or 'none'}")
        return None
    if not of and len(fitting) != 1:
        listed = ", ".join(fitting)
        text = f"the model has several columns of this role: say which by `of`: {listed}"
        section.fault("role", text if fitting else f'the model has no column of role "{role}"')
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
