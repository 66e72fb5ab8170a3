"""Reads `[requirement]`, or any number of `[[requirement]]`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from ...errors import Fault, nearest
from ...models.expressions import Formula, FormulaError, Intermediate
from ...models.inputs import Normal
from ...models.machine_offers import samples_of
from ...section import POSITIVE, Assumption, Range, Section
from ...units import family
from ..settings import SAMPLED, process_assumption, read_promise
from .definition import METHODS, Condition, Correlation, Definition, Part, Requirement
from .formulas import form_complaint, mechanisms_of, nominal_sum, sensitivity_faults, unknown_name
from .matched import assumptions_of_matching, matched_mechanisms, read_sortings
from .parts import MAX_PIECES, part_table, read_parts
from .promises import WINDOW

RESERVED = (
    "cost",
    "variation",
    "worst_case",
    "rss",
    "std",
    *WINDOW,
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
    faults += _repeated_name_faults(requirements)
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
    if why := output_complaint(name):
        section.fault("name", why)
        return stand_in
    return name


def output_complaint(name: str) -> str:
    """Why outputs cannot be named after a requirement or condition of that name, empty where they can."""
    known = f"{name} means something in [limits]; choose another name" if name in RESERVED else ""
    return form_complaint(name) or known


def _repeated_name_faults(requirements: list[Requirement]) -> list[Fault]:
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


# Reads requirements, `[[part]]` and `[[correlation]]` into a checked definition.


_REMEDIES = {
    "variables": "a stack states its ranges in [[part]]: t_min and t_max, or tolerance",
    "costs": "a stack states its costs in [[part]] or in a file, costs.file: none is assumed",
    "parameters": "a stack has no parameters: nominals stand in [[part]]",
}


def read_definition(
    top: Section, faults: list[Fault]
) -> tuple[list[Part | None], tuple[Requirement, ...], tuple[Condition, ...], Definition | None]:
    """Parts, requirements and conditions as far as they can be read, and the whole where nothing is wrong."""
    for key, message in _REMEDIES.items():
        if key in top:
            faults.append(Fault(key, message))
    if "method" in top.section("propagation"):
        text = "is not a key of a stack: set requirement.method"
        faults.append(Fault("propagation.method", text))
    requirements = read_requirements(top, faults)
    promise = read_promise(top)
    parts = read_parts(top, requirements, faults)
    conditions = _conditions(top, requirements, faults)
    top.accept(("feature",))
    if "feature" in top:
        from .features import read_features  # few stacks have any

        parts += read_features(top, requirements, parts, faults)
    whole = [part for part in parts if part is not None]
    if top.take("part") is None or top.take("part") == []:
        faults.append(Fault("part", "is missing: a stack needs [[part]] tables, or a workbook the sheet Parts"))
    intermediate, steps = _intermediate(top, whole if len(whole) == len(parts) else None, faults)
    sizes = [part for part in whole if part.feature is None]
    correlations = _correlations(top, sizes, len(whole) == len(parts), faults)
    sortings = read_sortings(top, whole if len(whole) == len(parts) else None, faults)
    if sortings and promise is not None:
        text = "is not known for parts that are sorted and matched: leave [promise] out, and limit yield_percent"
        faults.append(Fault("promise", text))
    if requirements[0].key:
        faults += sensitivity_faults(requirements, top.tables("part"))
    else:
        faults += _check_formula_or_sensitivities(requirements[0], top, parts)
    if not parts or any(not fault.place.startswith(("condition[", "matched")) for fault in faults):
        known = {fault.place for fault in faults}
        faults += [fault for fault in _name_faults(top, requirements, whole) if fault.place not in known]
        return parts, requirements, conditions, None
    mechanisms, stated = mechanisms_of(requirements, whole, correlations, steps, faults), requirements
    if len(mechanisms) == len(requirements):
        mechanisms = matched_mechanisms(mechanisms, whole, sortings, faults)
    if conditions and len(mechanisms) == len(requirements):
        from .conditions import stack_at

        requirements, mechanisms = stack_at(conditions, stated, whole, mechanisms, faults)
    if faults:
        return parts, stated, conditions, None
    given = correlations, sortings, promise, conditions, stated, intermediate
    return parts, stated, conditions, Definition(requirements, tuple(whole), mechanisms, *given)


def _name_faults(top: Section, requirements: tuple[Requirement, ...], parts: list[Part]) -> list[Fault]:
    """Formulas that are none, and names in them that no table states, where other tables have faults."""
    named = [str(table.get("name")) for key in ("part", "feature", "let") for table in top.tables(key)]
    for table in top.tables("part"):
        count = table.get("count")
        pieces = min(count, MAX_PIECES) if isinstance(count, int) else 0
        named += [f"{table.get('name')}_{at}" for at in range(1, 1 + pieces)]
    named += [f"{table.get('name')}_{axis}" for table in top.tables("feature") for axis in "xy"]
    for table in top.tables("loop"):
        named += unknowns if isinstance(unknowns := table.get("unknown"), dict) else []
    texts: list[tuple[str, object]] = [(f"{one.place}.formula", one.formula) for one in requirements]
    texts += [(f"let[{at}].formula", table.get("formula")) for at, table in enumerate(top.tables("let"))]
    faults = []
    for place, text in texts:
        try:
            formula = Formula(text) if isinstance(text, str) and text else None
        except FormulaError as error:
            faults.append(Fault(place, str(error)))
            continue
        written_names = formula.written.items() if formula else ()
        reasons = (unknown_name(name, column, parts, named) for name, column in written_names)
        faults += [Fault(place, why) for why in reasons if why]
    return faults


def _conditions(top: Section, requirements: tuple[Requirement, ...], faults: list[Fault]) -> tuple[Condition, ...]:
    """The temperatures of `[[condition]]`, in its order."""
    top.accept(("condition",))
    if "condition" not in top:
        return ()
    from .conditions import read_conditions  # few stacks have any

    return read_conditions(top, requirements, faults)


def _intermediate(
    top: Section, parts: list[Part] | None, faults: list[Fault]
) -> tuple[dict[str, Any], tuple[Intermediate, ...]]:
    """`[[let]]` and `[[loop]]` as they are written, and the quantities that they state."""
    top.accept(("let", "loop"))
    if "let" not in top and "loop" not in top:
        return {}, ()
    from .intermediate import read_intermediate  # few stacks have any

    return read_intermediate(top, parts, faults)


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
        bad = [why for name in names if complete and (why := _correlation_obstacle(name, owners, parts))]
        for why in bad:
            section.fault("parts", why)
        if len(names) != 2 or bad or coefficient is None:
            continue
        pair = (names[0], names[1])
        if any(set(correlation.pieces) == set(pair) for correlation in correlations):
            section.fault("parts", f"{names[0]} and {names[1]} are already correlated above")
        correlations.append(Correlation(pair, coefficient))
    return tuple(correlations)


def _correlation_obstacle(name: str, owners: dict[str, Part], parts: list[Part]) -> str:
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


def _check_formula_or_sensitivities(requirement: Requirement, top: Section, parts: list[Part | None]) -> list[Fault]:
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


# The tables that a stack is written in: reading them again gives the same stack.


def tables_of(definition: Definition) -> dict[str, Any]:
    """`[requirement]` or each `[[requirement]]`, `[[part]]` and `[[correlation]]`."""
    requirements = [_requirement(requirement) for requirement in definition.stated]
    tables: dict[str, Any] = {
        "requirement": requirements if definition.stated[0].key else requirements[0],
        "part": [part_table(part) for part in definition.parts if part.feature is None],
        **definition.intermediate,
    }
    if features := [dict(part.feature.stated) for part in definition.parts if part.feature is not None]:
        tables["feature"] = features
    if definition.correlations:
        tables["correlation"] = [
            {"parts": list(correlation.pieces), "coefficient": correlation.coefficient}
            for correlation in definition.correlations
        ]
    if definition.sortings:
        tables["matched"] = [dict(sorting.stated) for sorting in definition.sortings]
    if definition.conditions:
        tables["condition"] = [asdict(condition) for condition in definition.conditions]
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


# Assumptions of a stack about what its configuration does not state.


UNMEASURED = "no part is measured: its scatter counts as known, and as normal where yields are promised"


def assumptions_of(definition: Definition) -> tuple[Assumption, ...]:
    """Distributions and units that no table names, unverified grades, a summed nominal."""
    assumptions, process = [], process_assumption(definition.promise)
    for part in definition.parts:
        law = type(part.distribution).__name__ if part.feature is None else part.feature.law
        values = {"distribution": law, "unit": part.unit}
        if part.sample is not None:
            known = part.sample.statement(part.unit)
            assumptions.append(Assumption(f"part.{part.name}.measured", known, "", process))
        elif not part.sampled and process == SAMPLED:
            assumptions.append(Assumption(f"{part.place}.process", values["distribution"], "", UNMEASURED))
        for machine, sample in samples_of(part.machines):
            place = f"part.{part.name}.machine.{machine}.measured"
            assumptions.append(Assumption(place, sample.statement(part.unit), "", process))
        for key, why in part.assumed.items():
            value = values.get(key) or str(part.stated.get(key, ""))
            assumptions.append(Assumption(f"{part.label.replace(' ', '.')}.{key}", value, "", why))
    for requirement, mechanism in zip(definition.stated, definition.mechanisms, strict=False):
        if not requirement.formula and requirement.nominal is None and mechanism.bounded:
            place = f"{requirement.place}.nominal"
            text = f"sum of sensitivity times nominal; {place} is not given"
            nominal = nominal_sum(requirement, definition.parts)
            assumptions.append(Assumption(place, nominal, requirement.unit, text))
    assumptions += assumptions_of_matching(definition.sortings)
    if definition.conditions:
        from .conditions import thermal_assumptions

        assumptions += thermal_assumptions(definition)
    return tuple(assumptions)
