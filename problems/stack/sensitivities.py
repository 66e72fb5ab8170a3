"""Reads the sensitivity of a part: a number, or a number for each of several requirements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ...errors import Fault, nearest
from ...section import Section
from ...units import family
from .definition import Part, Requirement


def read_sensitivities(section: Section, unit: str | None, requirements: Sequence[Requirement]) -> dict[str, float]:
    """d requirement / d part by the key of the requirement; `unit` is that of the part."""
    if "sensitivity" not in section:
        section.accept(("sensitivity",))
        return {}
    several = any(requirement.key for requirement in requirements)
    if not several:
        return _single_sensitivity(section, requirements[0].key)
    if not isinstance(section.take("sensitivity"), Mapping):
        keys = ", ".join(f"{requirement.key} = ..." for requirement in requirements[:3])
        section.fault("sensitivity", f"must state the requirement: write sensitivity = {{ {keys} }}")
        return {}
    table, sensitivities = section.section("sensitivity"), dict[str, float]()
    known = {requirement.key: requirement for requirement in requirements}
    for key in table.all_keys():
        if key not in known:
            close = nearest(key, known)
            table.take(key)
            table.fault(key, f'"{key}" is not the name of a [[requirement]]{close}')
        elif (value := table.number(key, _quotient(known[key].unit, unit))) is not None:
            sensitivities[key] = value
    return sensitivities


def _single_sensitivity(section: Section, key: str) -> dict[str, float]:
    """The one number of a stack with one requirement."""
    value = section.number("sensitivity")
    if value == 0.0:
        section.fault("sensitivity", "must not be 0: the part does not matter; remove it")
    return {} if value is None else {key: value}


def _quotient(unit: str, per: str | None) -> str:
    """The unit of a sensitivity; empty for a plain number."""
    try:
        same = per is None or family(unit) == family(per)
    except ValueError:
        same = True
    return "" if same and unit == (per or "") else f"{unit or '1'}/{per}" if per else unit


def sensitivity_faults(requirements: Sequence[Requirement], tables: Sequence[Mapping[str, Any]]) -> list[Fault]:
    """A formula or sensitivities for each requirement, never both, and no part without effect.

    `tables` are those of the parts, faulty ones included.
    """
    keys = [key for table in tables for key in _keys(table)]
    faults = []
    for requirement in requirements:
        if requirement.formula and requirement.key in keys:
            text = f"is given in addition to {requirement.place}.formula: keep only one of the two"
            faults += [
                Fault(f"part[{at}].sensitivity.{requirement.key}", text + _name(table))
                for at, table in enumerate(tables)
                if requirement.key in _keys(table)
            ]
        elif not requirement.formula and requirement.key and requirement.key not in keys:
            text = (
                f'"{requirement.key}" has no parts: give it a formula, or name it in the '
                f"sensitivity of a part, like sensitivity = {{ {requirement.key} = 1.0 }}"
            )
            faults.append(Fault(requirement.place, text))
    if not any(requirement.formula for requirement in requirements):
        text = "is missing: no requirement depends on the part"
        faults += [
            Fault(f"part[{at}].sensitivity", text + _name(table))
            for at, table in enumerate(tables)
            if "sensitivity" not in table
        ]
    return faults


def needless(parts: Sequence[Part], used: Sequence[bool]) -> list[Fault]:
    """A fault for every part on which no requirement depends."""
    return [
        Fault(f"part[{at}].name", f"no requirement depends on it: remove it (part {part.name})")
        for at, (part, is_used) in enumerate(zip(parts, used, strict=True))
        if not is_used
    ]


def _keys(table: Mapping[str, Any]) -> tuple[str, ...]:
    value = table.get("sensitivity")
    return tuple(value) if isinstance(value, Mapping) else ()


def _name(table: Mapping[str, Any]) -> str:
    name = table.get("name")
    return f" (part {name})" if isinstance(name, str) else ""
