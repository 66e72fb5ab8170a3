"""Assumptions of a stack about what its configuration does not state."""

from __future__ import annotations

from ...declarations import Assumption
from ...models.machines.offers import samples_of
from ..assumptions import SAMPLED, process_assumption
from .build import nominal_sum
from .definition import Definition

UNMEASURED = "no part is measured: its scatter counts as known, and as normal where yields are promised"


def assumptions_of(definition: Definition) -> tuple[Assumption, ...]:
    """Distributions and units that no table names, unverified grades, a summed nominal."""
    assumptions, process = [], process_assumption(definition.promise)
    for part in definition.parts:
        values = {"distribution": type(part.distribution).__name__, "unit": part.unit}
        if part.sample is not None:
            known = part.sample.statement(part.unit)
            assumptions.append(Assumption(f"part.{part.name}.measured", known, "", process))
        elif not part.sampled and process == SAMPLED:
            assumptions.append(Assumption(f"part.{part.name}.process", values["distribution"], "", UNMEASURED))
        for machine, sample in samples_of(part.machines):
            place = f"part.{part.name}.machine.{machine}.measured"
            assumptions.append(Assumption(place, sample.statement(part.unit), "", process))
        for key, why in part.assumed.items():
            value = values.get(key) or str(part.stated.get(key, ""))
            assumptions.append(Assumption(f"part.{part.name}.{key}", value, "", why))
    for requirement, mechanism in zip(definition.requirements, definition.mechanisms, strict=True):
        if not requirement.formula and requirement.nominal is None and mechanism.bounded:
            place = f"{requirement.place}.nominal"
            text = f"sum of sensitivity times nominal; {place} is not given"
            nominal = nominal_sum(requirement, definition.parts)
            assumptions.append(Assumption(place, nominal, requirement.unit, text))
    return tuple(assumptions)
