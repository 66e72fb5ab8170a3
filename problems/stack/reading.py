"""Reads requirements, `[[part]]` and `[[correlation]]` into a checked definition."""

from __future__ import annotations

from ...errors import Fault, nearest
from ...models.inputs import Normal
from ...section import Range, Section
from ..promise import read_promise
from .build import mechanisms_of
from .definition import Correlation, Definition, Part, Requirement
from .parts import read_parts
from .requirements import read_requirements
from .sensitivities import sensitivity_faults

_REMEDIES = {
    "variables": "a stack states its ranges in [[part]]: t_min and t_max, or tolerance",
    "costs": "a stack states its costs in [[part]] or in a file, costs.file: none is assumed",
    "parameters": "a stack has no parameters: nominals stand in [[part]]",
}


def read_definition(
    top: Section, faults: list[Fault]
) -> tuple[list[Part | None], tuple[Requirement, ...], Definition | None]:
    """Parts and requirements as far as they can be read, and the whole where nothing is wrong."""
    for key, message in _REMEDIES.items():
        if key in top:
            faults.append(Fault(key, message))
    if "method" in top.section("propagation"):
        text = "is not a key of a stack: set requirement.method"
        faults.append(Fault("propagation.method", text))
    requirements = read_requirements(top, faults)
    promise = read_promise(top)
    parts = read_parts(top, requirements, faults)
    if top.take("part") is None or top.take("part") == []:
        faults.append(Fault("part", "is missing: a stack needs [[part]] tables"))
    whole = [part for part in parts if part is not None]
    correlations = _correlations(top, whole, len(whole) == len(parts), faults)
    if requirements[0].key:
        faults += sensitivity_faults(requirements, top.tables("part"))
    else:
        faults += _either(requirements[0], top, parts)
    if faults or not parts:
        return parts, requirements, None
    mechanisms = mechanisms_of(requirements, whole, correlations, faults)
    if faults:
        return parts, requirements, None
    definition = Definition(requirements, tuple(whole), mechanisms, correlations, promise)
    return parts, requirements, definition


def _correlations(top: Section, parts: list[Part], complete: bool, faults: list[Fault]) -> tuple[Correlation, ...]:
    """`[[correlation]]`: parts = ["a", "b"], coefficient."""
    owners = {piece: part for part in parts for piece in part.pieces}
    correlations: list[Correlation] = []
    for at in range(len(top.tables("correlation"))):
        section = top.item("correlation", at, faults)
        names = section.names("parts") or []
        coefficient = section.number("coefficient", within=Range(-1.0, 1.0))
        if "coefficient" not in section:
            section.fault("coefficient", "is missing")
        section.finish()
        if "parts" not in section:
            section.fault("parts", 'is missing: name two, like parts = ["a", "b"]')
        elif names and (len(names) != 2 or names[0] == names[1]):
            section.fault("parts", f"must name two different parts, got {', '.join(names)}")
        bad = [why for name in names if complete and (why := _uncorrelated(name, owners, parts))]
        for why in bad:
            section.fault("parts", why)
        if len(names) != 2 or bad or coefficient is None:
            continue
        pair = (names[0], names[1])
        if any(set(correlation.pieces) == set(pair) for correlation in correlations):
            section.fault("parts", f"{names[0]} and {names[1]} are already correlated above")
        correlations.append(Correlation(pair, coefficient))
    return tuple(correlations)


def _uncorrelated(name: str, owners: dict[str, Part], parts: list[Part]) -> str:
    """Why a piece cannot be correlated, empty where it can."""
    for part in parts:
        if part.name == name and part.count > 1:
            return f"{name} is built in {part.count} times: name {part.pieces[0]}, ..."
    if name not in owners:
        return f'"{name}" is not a part{nearest(name, owners)}'
    if owners[name].by_machine:
        return f"{name} is made by machines: only parts whose scatter follows their tolerance can be correlated"
    if not isinstance(owners[name].distribution, Normal):
        return f"{name} is not normal: only normal parts can be correlated"
    return ""


def _either(requirement: Requirement, top: Section, parts: list[Part | None]) -> list[Fault]:
    """A formula, or a sensitivity for every part, never both."""
    tables = top.tables("part")
    given = ["sensitivity" in table for table in tables]
    names = [f" (part {name})" if isinstance(name := table.get("name"), str) else "" for table in tables]
    if requirement.formula:
        text = "is given in addition to requirement.formula: keep only one of the two"
        return [Fault(f"part[{at}].sensitivity", text + names[at]) for at, is_stated in enumerate(given) if is_stated]
    section = top.section("requirement")
    if not any(given):
        if "formula" in section and section.take("formula") != "":
            return []
        text = "is missing: give a formula, or a sensitivity for every part"
        return [Fault("requirement.formula", text)]
    text = "is missing: without a formula every part needs a sensitivity"
    return [Fault(f"part[{at}].sensitivity", text + names[at]) for at, is_stated in enumerate(given) if not is_stated]
