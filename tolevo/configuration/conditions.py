"""Reads `[[condition]]` of a problem that is not a stack: temperatures, hours, loads and effects in it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import Any

from .. import registry
from ..errors import Fault, nearest
from ..models.effects.measurements import Active
from ..problems.conditions import (
    APART,
    DISC,
    HOUSING,
    THERMAL,
    Condition,
    InConditions,
    OperatingConditions,
    contradictory,
    declaration_in,
    limitable,
    limits_in_all,
)
from ..problems.declaration import ConfiguredProblem, Declaration
from ..problems.settings import Bound
from ..section import Range, Section, Value, flat
from .parameters import read_effects, read_parameters, resolved_effects
from .plugins import ModelClass

ABSOLUTE_ZERO_C = -273.15
TEMPERATURE = Range(ABSOLUTE_ZERO_C)
DIFFERENCE = Range(-100.0, 100.0)
"""Differences of temperature [K] within one drive: that of `differential_thermal_expansion`."""
HOURS = Range(0.0, 1e6)
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
RESERVED = ("min", "max")
"""Keys of a limit, which no condition can be named after."""


def with_conditions(
    configured: ConfiguredProblem, top: Section, model: ModelClass | None, model_name: str
) -> ConfiguredProblem:
    """The problem in the conditions of its configuration; as it is where none of them is valid."""
    plain = configured.declaration
    known = {p.name: p for p in (*(model.parameters if model else ()), *plain.parameters)}
    taken = {output.name for output in plain.outputs} | {variable.name for variable in plain.variables}
    conditions: list[Condition] = []
    for section in top.items("condition"):
        condition = _condition(section, plain, known, [*taken, *(c.name for c in conditions)])
        effects = read_effects(top, model, model_name, section)
        section.accept(("limits", "minimise"))
        section.finish()
        if condition is not None:
            own = (*condition.effects, *effects)
            written = {**condition.stated, **resolved_effects(effects)}
            conditions.append(replace(condition, effects=own, stated=written))
    if "promise" in top:
        top.fault("promise", "is of one condition: with [[condition]], limit yield_percent in each of them instead")
    if not conditions:
        return configured
    operating = OperatingConditions(configured.make, tuple(conditions))
    declaration = declaration_in(operating.names, plain)
    outputs = limitable(declaration.outputs, plain.outputs, operating.names, top)
    read = {**configured.read, "operating": operating}
    return ConfiguredProblem(replace(declaration, outputs=outputs), InConditions, read)


def read_as_a_whole(
    top: Section,
    sections: Mapping[str, Section],
    declared: Declaration,
    objectives: Sequence[str],
    limits: Mapping[str, Bound],
    searched: bool,
) -> dict[str, Bound]:
    """The limits of a run that do not contradict those in conditions, whose tables are `sections`; a fault for
    each that does, and, where designs are `searched`, for each condition that no limit, of the choice neither, and no
    objective belongs to.
    """
    outputs = {output.name for output in declared.outputs}
    plain = {output.partition(".")[2] for output in outputs if output.partition(".")[0] in sections} & outputs
    names = outputs.union(variable.name for variable in declared.variables) - plain
    wrong = contradictory(limits_in_all(sections, dict(declared.limits) | dict(limits), names))
    asked = [*limits, *declared.limits, *(objectives or declared.objectives)]
    misread = any(fault.place.startswith(("limits", "objectives", "promise")) for fault in top.faults)
    limited = {name.partition(".")[0] for name in limits}
    listed = "condition" in declared.tables and limited.isdisjoint(sections)  # the sheet of a stack, not a search
    if searched and not (misread or listed or "promise" in top or plain.intersection(asked)):
        chosen = top.section("choice").take("limits")
        asked += flat(chosen) if isinstance(chosen, dict) else {}
        held = {name.partition(".")[0] for name in asked}
        text = "has no limit and no objective: state limits or minimise in it, or a limit that holds in all conditions"
        for name in [name for name in sections if name not in held]:
            if not sections[name].take("limits") and "minimise" not in sections[name]:
                sections[name].fault("", f"{name} {text}")
    for fault in wrong:
        top.fault(fault.place, fault.message)
    return {name: bound for name, bound in limits.items() if f"limits.{name}" not in {fault.place for fault in wrong}}


def as_written(fault: Fault, top: Section) -> Fault:
    """The fault of a limit in a condition at the key that states it, the tighter one of two."""
    condition, _, output = fault.place.removeprefix("limits.").partition(".")
    own = next((section for section in top.items("condition") if section.take("name") == condition), None)
    if not fault.place.startswith("limits.") or not output or own is None:
        return fault
    tables = {"limits": top.take("limits"), f"{own.place()}.limits": own.take("limits")}
    found = {place: flat(table) for place, table in tables.items() if isinstance(table, dict)}
    keys = {f"{place}.{key}": value for place, values in found.items() for key, value in values.items()}

    def most(place: str) -> float:
        value = keys.get(place, keys.get(f"{place}.max"))
        return float(value) if isinstance(value, int | float) else inf

    places = (fault.place, f"{own.place()}.limits.{output}", f"limits.{output}")
    written = [place for place in places if any(f"{key}.".startswith(f"{place}.") for key in keys)]
    return replace(fault, place=min(written, key=most, default=fault.place))


def _condition(section: Section, plain: Declaration, known: Mapping[str, Any], taken: list[str]) -> Condition | None:
    """A condition with the effect of its temperatures; None where it has no valid name."""
    name = section.text("name")
    if "name" not in section:
        section.fault("name", "is missing: outputs of conditions are distinguished by it")
    elif name is not None and not NAME.fullmatch(name):
        section.fault("name", f'must be of letters, digits and _, a letter first, got "{name}"')
        name = None
    elif name in taken or name in RESERVED:
        section.fault("name", f"{name} is the name of an output, variable or condition; choose another name")
        name = None
    stated: dict[str, Any] = {"name": name}
    numbers = {
        "temperature_C": section.number("temperature_C", "degC", TEMPERATURE),
        DISC: section.number(DISC, "degC", TEMPERATURE),
        HOUSING: section.number(HOUSING, "degC", TEMPERATURE),
        APART: section.number(APART, "K", DIFFERENCE),
        "hours": section.number("hours", "h", HOURS),
    }
    stated |= {key: value for key, value in numbers.items() if value is not None}
    difference = _difference(section, numbers)
    parameters = _parameters(section, plain, known, stated)
    effects = () if not difference else (Active(registry.load("effects", THERMAL)(), {APART: difference}),)
    hours = numbers["hours"] or 0.0
    return None if name is None else Condition(name, section.place(), effects, parameters, hours, stated)


def _difference(section: Section, numbers: Mapping[str, float | None]) -> float:
    """The temperature of the discs less that of the housing [K]; what is not stated is at `temperature_C`."""
    apart, disc, housing = numbers[APART], numbers[DISC], numbers[HOUSING]
    if apart is not None:
        for key in (DISC, HOUSING):
            if key in section:
                section.fault(key, f"is stated in addition to {APART}: keep one of them")
        return apart
    common = numbers["temperature_C"]
    if disc is None and housing is None:
        return 0.0
    ends = [common if end is None else end for end in (disc, housing)]
    for key, end in zip((DISC, HOUSING), ends, strict=True):
        if end is None and key not in section:
            section.fault(key, f"is missing: the other temperature is stated; state it, temperature_C or {APART}")
    if ends[0] is None or ends[1] is None:
        return 0.0
    difference = ends[0] - ends[1]
    if why := DIFFERENCE.complaint(difference):
        section.fault(DISC, f"the difference to the housing {why}, got {difference:g} K")
        return 0.0
    return difference


def _parameters(
    section: Section, plain: Declaration, known: Mapping[str, Any], stated: dict[str, Any]
) -> dict[str, Value]:
    """Operating parameters by keys of the condition; what `stated` holds of them is added."""
    parameters: dict[str, Value] = {}
    for key, names in plain.operation.items():
        first = known[names[0]]
        value = section.number(key, first.unit, Range(first.low, first.high))
        if value is not None:
            parameters |= dict.fromkeys(names, value)
            stated[key] = value
    allowed = [known[name] for names in plain.operation.values() for name in names]
    table = section.section("parameters")
    for key in table.all_keys():
        if key in known and known[key] not in allowed:
            table.take(key)
            others = ", ".join(parameter.name for parameter in allowed) or "none"
            table.fault(key, f"belongs to the unit, which is the same in all conditions; those of operation: {others}")
        elif key not in known:
            table.take(key)
            table.fault(key, f"is not a parameter of operation{nearest(key, [p.name for p in allowed])}")
    given = read_parameters(table, allowed)
    if given:
        stated["parameters"] = given
    return parameters | given
