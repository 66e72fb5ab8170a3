"""Reads `[requirement]`, or any number of `[[requirement]]`."""

from __future__ import annotations

import re

from ...errors import Fault
from ...section import POSITIVE, Section
from ...units import family
from .definition import METHODS, Requirement

_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
RESERVED = (
    "cost",
    "variation",
    "worst_case",
    "rss",
    "yield_percent",
    "yield_percent_error",
    "domain_margin",
    "min",
    "max",
)
"""Names that a requirement cannot have: outputs of the whole stack, and keys of a limit."""


def read_requirements(top: Section, faults: list[Fault]) -> tuple[Requirement, ...]:
    """Every requirement, at least one; what is faulty in it has its default."""
    if "requirement" not in top:
        faults.append(Fault("requirement", "is missing: name its unit, formula and limits"))
    if not isinstance(top.take("requirement"), list):
        return (_read(top.collecting("requirement", faults), "requirement", False),)
    tables = top.tables("requirement")
    if not tables:
        faults.append(Fault("requirement", "must list at least one [[requirement]] table"))
        return (Requirement("", ""),)
    requirements = [_read(top.item("requirement", at, faults), f"requirement[{at}]", True) for at in range(len(tables))]
    faults += _twice(requirements)
    return tuple(requirements)


def _read(section: Section, place: str, several: bool) -> Requirement:
    unit = section.text("unit") or ""
    if section.all_keys() and "unit" not in section:
        section.fault("unit", 'is missing: write "mm", "rad", "deg", ... ("" for a plain number)')
    try:
        family(unit)
    except ValueError as error:
        section.fault("unit", str(error))
        unit = "mm"  # most likely, so that parts without a unit of their own are no faults as well
    lower, upper = (section.number(key, unit) for key in ("lower", "upper"))
    if lower is not None and upper is not None and lower >= upper:
        section.fault("lower", f"must be below upper ({upper:g}), got {lower:g}")
    nominal = section.number("nominal", unit)
    name = _key(section, place) if several else section.text("name") or ""
    weight = section.number("weight", within=POSITIVE) if several else None
    requirement = Requirement(
        name=name,
        unit=unit,
        formula=section.text("formula") or "",
        nominal=nominal,
        stated_nominal=None if nominal is None else section.take("nominal"),
        lower=lower,
        upper=upper,
        method=section.text("method", METHODS) or "rss",
        weight=1.0 if weight is None else weight,
        key=name if several else "",
        place=place,
        description=section.text("description") or "",
        drawing=section.text("drawing") or "",
    )
    section.finish()
    return requirement


def _key(section: Section, place: str) -> str:
    """The name of one of several requirements; a stand-in where it has none that is valid."""
    name, stand_in = section.text("name"), place.replace("[", "_").replace("]", "")
    if "name" not in section:
        section.fault("name", "is missing: outputs of several requirements are distinguished by their names")
    if name is None:
        return stand_in
    if not _NAME.fullmatch(name):
        text = f'must be letters, digits and _, and begin with a letter, got "{name}"'
        section.fault("name", text)
        return stand_in
    if name in RESERVED:
        section.fault("name", f"{name} means something in [limits]; choose another name")
        return stand_in
    return name


def _twice(requirements: list[Requirement]) -> list[Fault]:
    """A fault for every name that an earlier requirement has."""
    names = [requirement.key for requirement in requirements]
    return [
        Fault(
            f"{requirement.place}.name",
            f'"{requirement.key}" is already the name of requirement[{names.index(requirement.key)}]',
        )
        for at, requirement in enumerate(requirements)
        if requirement.key in names[:at]
    ]
