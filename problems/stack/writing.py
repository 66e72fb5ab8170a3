"""The tables that a stack is written in: reading them again gives the same stack."""

from __future__ import annotations

from typing import Any

from ...models.costs.reading import curve_table
from ...models.inputs.reading import written
from .definition import Definition, Part, Process, Requirement


def tables_of(definition: Definition) -> dict[str, Any]:
    """`[requirement]` or each `[[requirement]]`, `[[part]]` and `[[correlation]]`."""
    each = [_requirement(one) for one in definition.requirements]
    found: dict[str, Any] = {
        "requirement": each if definition.requirement.key else each[0],
        "part": [_part(part) for part in definition.parts],
    }
    if definition.correlations:
        found["correlation"] = [
            {"parts": list(one.pieces), "coefficient": one.coefficient}
            for one in definition.correlations
        ]
    if definition.promise is not None:
        found["promise"] = definition.promise.table()
    return found


def _requirement(requirement: Requirement) -> dict[str, Any]:
    found = {
        "name": requirement.name or None,
        "unit": requirement.unit,
        "formula": requirement.formula or None,
        "nominal": requirement.stated_nominal,
        "lower": requirement.lower,
        "upper": requirement.upper,
        "method": requirement.method,
        "weight": requirement.weight if requirement.key else None,
        "description": requirement.description or None,
        "drawing": requirement.drawing or None,
    }
    return {key: value for key, value in found.items() if value is not None}


def _part(part: Part) -> dict[str, Any]:
    found: dict[str, Any] = {"name": part.name, "unit": part.unit, "count": part.count}
    if part.nominal is not None:
        found["nominal"] = part.nominal
    if part.sensitivities:
        found["sensitivity"] = part.sensitivities.get("", dict(part.sensitivities))
    found |= (
        written(part.distribution)
        if part.sample is None
        else {"measured": dict(part.sample.stated)}
    )
    labels = {
        "drawing": part.drawing,
        "characteristic": part.characteristic,
        "geometry": part.geometry,
    }
    found |= {key: value for key, value in labels.items() if value}
    if part.machines:
        own = [{"name": p.name} | _range(p) for p in part.processes if p.machine is None]
        return (
            found
            | ({"process": own} if own else {})
            | {"machine": [one.table() for one in part.machines]}
        )
    if part.alternatives and part.stated:  # grades
        return found | dict(part.stated)
    if part.alternatives:
        return found | {"process": [{"name": p.name} | _range(p) for p in part.processes]}
    if part.fixed:
        return found | dict(part.stated) | _cost(part.processes[0])
    return found | _range(part.processes[0])


def _range(process: Process) -> dict[str, Any]:
    return {"t_min": process.low, "t_max": process.high} | _cost(process)


def _cost(process: Process) -> dict[str, Any]:
    return {} if process.curve is None else {"cost": curve_table(process.curve)}
