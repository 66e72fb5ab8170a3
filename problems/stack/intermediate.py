"""Quantities between the parts and the formulas of a stack: `[[let]]` names them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from typing import Any

from ...errors import Fault
from ...models.expressions import Formula, FormulaError, Intermediate, Let
from ...section import Section
from .definition import Part, Requirement, base_units
from .formulas import name_complaint, unknown_name


def read_lets(top: Section, faults: list[Fault]) -> tuple[Let, ...]:
    """Every `[[let]]` that can be read, with its name and its formula."""
    lets = []
    for at in range(len(top.tables("let"))):
        section = top.item("let", at, faults)
        name, text = read_name(section), section.text("formula")
        if "formula" not in section:
            section.fault("formula", 'is missing: write the quantity as a function of parts, like "hub/2 + gap"')
        section.finish()
        formula = None if text is None else read_formula(section, "formula", text)
        if name is not None and formula is not None:
            lets.append(Let(name, formula, section.place()))
    return tuple(lets)


def read_name(section: Section) -> str | None:
    """The name of a quantity in formulas, None and a fault where it cannot be one."""
    name = section.text("name")
    if "name" not in section:
        section.fault("name", "is missing: formulas use the quantity by its name")
    elif name is not None and (why := name_complaint(name)):
        section.fault("name", why)
        return None
    return name


def read_formula(section: Section, key: str, text: str) -> Formula | None:
    """The formula, None and a fault where the text is none."""
    try:
        return Formula(text)
    except FormulaError as error:
        section.fault(key, str(error))
        return None


# The order in which they follow from the parts.


def arranged(steps: Sequence[Intermediate], parts: Sequence[Part], faults: list[Fault]) -> tuple[Intermediate, ...]:
    """The quantities, each after those that it depends on; fewer and every fault where names are
    ambiguous or unknown, or where a quantity depends on itself.
    """
    before, owners = len(faults), {piece: part.name for part in parts for piece in part.names}
    by_name: dict[str, Intermediate] = {}
    for step in steps:
        for name in step.names:
            other = f"part {owners[name]}" if name in owners else by_name[name].place if name in by_name else ""
            if other:
                faults.append(Fault(step.place, f'"{name}" is already a name of {other}; rename one of the two'))
            by_name.setdefault(name, step)
    for step in steps:
        faults += [
            Fault(f"{step.place}.formula", why)
            for name, column in step.inputs.items()
            if (why := unknown_name(name, column, parts, by_name))
        ]
    graph = {at: [steps.index(by_name[n]) for n in step.inputs if n in by_name] for at, step in enumerate(steps)}
    try:
        order = list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        names = [", ".join(steps[at].names) for at in reversed(error.args[1])]
        text = f"depends on itself: {' -> '.join(names)}; write one of them in terms of parts"
        faults.append(Fault(steps[error.args[1][0]].place, text))
    return tuple(steps[at] for at in order) if len(faults) == before else ()


def intermediate_faults(
    steps: Sequence[Intermediate], used: Sequence[tuple[Requirement, Formula]], parts: Sequence[Part]
) -> list[Fault]:
    """Quantities that no requirement needs, and those whose numbers would be in two units."""
    faults = []
    for step in steps:
        users = [(requirement, formula) for requirement, formula in used if step in formula.given]
        if not users:
            text = f"no requirement depends on {', '.join(step.names)}: use it in a formula, or leave it out"
            faults.append(Fault(step.place, text))
        bases: dict[str, tuple[float, Requirement]] = {}
        for requirement, formula in users:
            named = [part for part in parts if any(piece in formula.names for piece in part.pieces)]
            for kind, factor in base_units(requirement, named).items():
                other = bases.setdefault(kind, (factor, requirement))
                if other[0] != factor:
                    text = (
                        f"is used by {other[1].place} and {requirement.place}, whose formulas count in different "
                        f'units ("{other[1].unit}" and "{requirement.unit}"): give both requirements the same unit'
                    )
                    faults.append(Fault(step.place, text))
    return faults


def intermediate_tables(steps: Iterable[Intermediate]) -> dict[str, Any]:
    """The tables that state the quantities: reading them again gives the same."""
    tables: dict[str, list[Mapping[str, Any]]] = {}
    for step in steps:
        if isinstance(step, Let):
            tables.setdefault("let", []).append({"name": step.name, "formula": step.formula.text})
    return tables
