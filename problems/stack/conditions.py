"""`[[condition]]`: the requirements of a stack at temperatures other than that of its drawings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...errors import Fault
from ...models.stack.mechanism import Mechanism, least_margin
from ...section import Array, Assumption, Range, Section
from ...units import family
from .definition import Condition, Definition, Part, Requirement
from .formulas import domain_violation, linearise_mechanism

REFERENCE_C = 20.0
"""Temperature at which a drawing states sizes (ISO 1:2022)."""
ABSOLUTE_ZERO_C = -273.15
MATERIALS: Mapping[str, tuple[float, str]] = {
    "steel": (11.5e-6, "gauge blocks, ISO 3650:1998, 6.2.2"),
    "stainless_steel": (16.0e-6, "1.4301, 20 to 100 degC, EN 10088-1"),
    "cast_iron": (11.7e-6, "grey, 20 to 200 degC, EN 1561"),
    "aluminium": (23.0e-6, "alloys, EN 1999-1-1, 3.2.5"),
    "copper": (16.5e-6, "pure, 25 degC, CRC Handbook of Chemistry and Physics"),
    "titanium": (8.6e-6, "pure, 25 degC, CRC Handbook of Chemistry and Physics"),
    "magnesium": (24.8e-6, "pure, 25 degC, CRC Handbook of Chemistry and Physics"),
}
"""Linear expansion [1/K] of a material, and what it is of; alloys differ by some per cent."""
PLAUSIBLE = Range(-1e-4, 1e-3)
"""Linear expansions [1/K] of solids, from fibre composites to elastomers."""


def read_expansion(section: Section, unit: str | None) -> tuple[float | None, str]:
    """Linear expansion [1/K] of a part and its `material`; None and empty where they are not stated."""
    expansion, material = section.number("expansion", "1/K", PLAUSIBLE), section.text("material", MATERIALS)
    if "expansion" in section and "material" in section:
        section.fault("expansion", "is stated in addition to material: keep only one of the two")
    key = "material" if "material" in section else "expansion"
    if unit is not None and family(unit)[0] != "meter":
        section.fault(key, f"applies to lengths, not to a part in {unit or 'plain numbers'}")
    return (MATERIALS[material][0] if material else expansion), material or ""


def read_conditions(top: Section, requirements: Sequence[Requirement], faults: list[Fault]) -> tuple[Condition, ...]:
    """Every `[[condition]]` with a name and a temperature; its limits are read with those of the run."""
    from .reading import output_complaint  # which reads conditions only where there are some

    conditions: list[Condition] = []
    taken = {requirement.key for requirement in requirements}
    for at in range(len(top.tables("condition"))):
        section = top.item("condition", at, faults)
        name, temperature = section.text("name"), section.number("temperature_C", within=Range(ABSOLUTE_ZERO_C))
        section.accept(("limits", "minimise"))
        section.finish()
        for key, what in (("name", "outputs of conditions are distinguished by it"), ("temperature_C", "in degC")):
            if key not in section:
                section.fault(key, f"is missing: {what}")
        why = "" if name is None else output_complaint(name)
        if name in taken:
            why = why or f"{name} is the name of a requirement or condition; choose another name"
        if why:
            section.fault("name", why)
        elif name is not None:  # limits of one whose temperature is faulty are read as well
            conditions.append(Condition(name, REFERENCE_C if temperature is None else temperature))
            taken.add(name)
    return tuple(conditions)


def requirements_at(conditions: Sequence[Condition], requirements: Sequence[Requirement]) -> tuple[Requirement, ...]:
    """Every requirement in every condition, `<condition>.<requirement>`; that of `[requirement]` has the
    name of the condition.
    """
    return tuple(
        replace(
            requirement,
            key=f"{condition.name}.{requirement.key}" if requirement.key else condition.name,
            name=f"{requirement.name} ({condition.name})".lstrip(),
            place=f"{requirement.place} ({condition.name})",
        )
        for condition in conditions
        for requirement in requirements
    )


def stack_at(
    conditions: Sequence[Condition],
    requirements: Sequence[Requirement],
    parts: Sequence[Part],
    mechanisms: Sequence[Mechanism],
    faults: list[Fault],
) -> tuple[tuple[Requirement, ...], tuple[Mechanism, ...]]:
    """Requirements and mechanisms in every condition: each part is 1 + expansion (T - 20 degC) times as
    large, its deviations with it. Faults where a part has no size, or a formula no value.
    """
    faults += [
        Fault(f"part[{at}].nominal", f"is missing: the part expands with the temperature (part {part.name})")
        for at, part in enumerate(parts)
        if part.expansion and part.nominal is None
    ]
    if not any(part.expansion for part in parts):
        text = "changes nothing: no part has an expansion; state expansion or material of the parts"
        faults.append(Fault("condition", text))
    moved: list[Requirement] = []
    changed: list[Mechanism] = []
    at_conditions = iter(requirements_at(conditions, requirements))
    for condition in conditions:
        growth = np.array([1.0 + (part.expansion or 0.0) * (condition.temperature_C - REFERENCE_C) for part in parts])
        for mechanism, requirement in zip(mechanisms, requirements, strict=True):
            anew = _expanded(mechanism, parts, growth)
            if not np.isfinite(anew.centre):
                text = f"has no value at {condition.temperature_C:g} degC (condition {condition.name})"
                faults.append(Fault(f"{requirement.place}.formula", text))
            nominal = requirement.nominal
            sized = all(part.nominal is not None or part.feature is not None for part in parts)
            if not requirement.formula and (nominal is not None or sized):
                nominal = anew.centre - float(anew.sensitivities @ _means(parts)[anew.owners])
            moved.append(replace(next(at_conditions), nominal=nominal))
            changed.append(anew)
    return tuple(moved), tuple(changed)


def _means(parts: Sequence[Part]) -> Array:
    """Deviation of the mean of each part from its nominal (p,)."""
    return np.array([part.mean for part in parts])


def _expanded(mechanism: Mechanism, parts: Sequence[Part], growth: Array) -> Mechanism:
    """The mechanism of parts that are `growth` (p,) times as large."""
    by_piece = growth[mechanism.owners]
    sizes = np.array([part.nominal or 0.0 for part in parts]) + _means(parts)
    if mechanism.formula is None:
        added = float(mechanism.sensitivities @ (sizes * (growth - 1.0))[mechanism.owners])
        slopes = mechanism.sensitivities * by_piece
        return replace(mechanism, sensitivities=slopes, centre=mechanism.centre + added)
    _, mids, scale = mechanism.stated
    larger = replace(mechanism, mids=mids * by_piece, scale=scale * by_piece)
    loosest = np.array([part.high for part in parts])
    larger, _ = linearise_mechanism(larger, loosest[larger.owners])
    return replace(larger, undefined=domain_violation(larger, loosest, least_margin(larger, loosest[None, :])[0]))


def thermal_assumptions(definition: Definition) -> tuple[Assumption, ...]:
    """The temperature of the drawings, and what parts are made of."""
    listed = ", ".join(f"{condition.name} {condition.temperature_C:g} degC" for condition in definition.conditions)
    text = f"that of sizes and tolerances on a drawing, ISO 1; requirements hold in the conditions alone: {listed}"
    assumptions = [Assumption("condition.reference_temperature", REFERENCE_C, "degC", text)]
    for part in definition.parts:
        place = f"part.{part.name}.expansion"
        if part.material:
            assumptions.append(Assumption(place, part.expansion or 0.0, "1/K", MATERIALS[part.material][1]))
        elif part.expansion is None and part.feature is None and family(part.unit)[0] == "meter":
            text = "neither expansion nor material is stated: its size does not change with the temperature"
            assumptions.append(Assumption(place, 0.0, "1/K", text))
    return tuple(assumptions)
