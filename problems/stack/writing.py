"""The tables that a stack is written in: reading them again gives the same stack."""

from __future__ import annotations

from typing import Any

from ...models.costs.reading import curve_table
from ...models.inputs.reading import written
from .definition import Definition, Part, Process, Requirement


def tables_of(definition: Definition) -> dict[str, Any]:
    """`[requirement]` or each `[[requirement]]`, `[[part]]` and `[[correlation]]`."""
    requirements = [_requirement(requirement) for requirement in definition.requirements]
    tables: dict[str, Any] = {
        "requirement": requirements if definition.requirement.key else requirements[0],
        "part": [_part(part) for part in definition.parts],
    }
    if definition.correlations:
        tables["correlation"] = [
            {"parts": list(correlation.pieces), "coefficient": correlation.coefficient}
            for correlation in definition.correlations
        ]
    if definition.promise is not None:
        tables["promise"] = definition.promise.table()
    return tables


def _requirement(requirement: Requirement) -> dict[str, Any]:
    table = {
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
    return {key: value for key, value in table.items() if value is not None}


def _part(part: Part) -> dict[str, Any]:
    table: dict[str, Any] = {"name": part.name, "unit": part.unit, "count": part.count}
    if part.nominal is not None:
        table["nominal"] = part.nominal
    if part.sensitivities:
        table["sensitivity"] = part.sensitivities.get("", dict(part.sensitivities))
    table |= written(part.distribution) if part.sample is None else {"measured": dict(part.sample.stated)}
    labels = {"drawing": part.drawing, "characteristic": part.characteristic, "geometry": part.geometry}
    table |= {key: value for key, value in labels.items() if value}
    if part.machines:
        processes = [{"name": p.name} | _range(p) for p in part.processes if p.machine is None]
        return (
            table
            | ({"process": processes} if processes else {})
            | {"machine": [offer.table() for offer in part.machines]}
        )
    if part.alternatives and part.stated:  # grades
        return table | dict(part.stated)
    if part.alternatives:
        return table | {"process": [{"name": p.name} | _range(p) for p in part.processes]}
    if part.fixed:
        return table | dict(part.stated) | _cost(part.processes[0])
    return table | _range(part.processes[0])


def _range(process: Process) -> dict[str, Any]:
    return {"t_min": process.low, "t_max": process.high} | _cost(process)


def _cost(process: Process) -> dict[str, Any]:
    return {} if process.curve is None else {"cost": curve_table(process.curve)}
