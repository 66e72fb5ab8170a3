"""`[[claim.reading]]`: how a value is recomputed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from .. import registry
from ..errors import InputError, nearest
from ..models.expressions import Formula, FormulaError
from ..section import POSITIVE, Range, Section
from ..units import converted
from ..workflows.reproduce.recipes import (
    STATISTICS,
    ByCalculation,
    ByFormula,
    ByModel,
    ByProblem,
    Constant,
    Derivative,
    Recipe,
    Statistic,
)
from .configuration import Configuration
from .parameters import read_parameters
from .plugins import load_named
from .reader import read_table
from .simulated import arguments_of

KINDS = ("calculation", "model", "problem", "formula")
STUDY = "study"
"""Parameter of a calculation that may read the result of a study."""
LEVEL = Range(0.0, 1.0, open_low=True, open_high=True)


def read_recipe(section: Section, count: int, unit: str, study: str) -> Recipe | None:
    """The recipe of a reading of a claim in `unit`; None where it is faulty."""
    found = _recipe(section, count, study, unit)
    derived = _derived(section, found)
    if derived is not None and unit:
        _convertible(section, derived, unit)
    return derived


def _recipe(section: Section, count: int, study: str, unit: str = "") -> Recipe | None:
    """A recipe of `count` values; `unit` is that of a formula's results."""
    given = [kind for kind in KINDS if kind in section]
    if len(given) != 1:
        text = f"names {' and '.join(given)}; one is enough" if given else "names nothing"
        section.fault("", f"{text}: recompute by one of {', '.join(KINDS)}")
        section.known(section.given())
        return None
    match given[0]:
        case "calculation":
            return _by_calculation(section, count, study)
        case "model":
            return _by_model(section, count)
        case "problem":
            return _by_problem(section, count)
        case _:
            return _by_formula(section, count, unit, study)


def _names(section: Section, key: str, count: int, known: Mapping[str, Any]) -> tuple[str, ...]:
    """One name, or a list of as many as the claim prints; each of `known` where that is told."""
    value = section.take(key)
    names = [value] if isinstance(value, str) else section.names(key)
    if names is None:
        if value is None:
            section.fault(key, "is missing: name what is to be compared with the printed value")
        return ()
    if count and len(names) != count:
        section.fault(key, f"must name {count} as `printed` does, got {len(names)}")
    for name in names:
        if known and name not in known:
            text = f'"{name}" is not computed{nearest(name, known)}; known: {", ".join(known)}'
            section.fault(key, text)
    return tuple(names)


def _by_calculation(section: Section, count: int, study: str) -> Recipe | None:
    kind = load_named(section, "calculation", "calculations")
    if kind is None:
        section.known(["quantity", "parameters", "derivative"])
        return None
    known = {one.name: one.unit for one in kind.outputs}
    names = _names(section, "quantity", count, known)
    parameters = read_parameters(section.section("parameters"), kind.parameters)
    if study and any(one.name == STUDY for one in kind.parameters):
        parameters.setdefault(STUDY, study)
    return ByCalculation(kind, tuple(parameters.items()), names, section.place("quantity"))


def _configured(section: Section, keys: tuple[str, ...]) -> Configuration | None:
    """The configuration that some keys of a reading are; its faults are placed in the reading."""
    table = {key: section.take(key) for key in keys if key in section}
    try:
        return read_table(table, [])
    except InputError as error:
        for fault in error.faults:
            section.fault(fault.place, fault.message)
        return None


MODEL_KEYS = ("model", "parameters", "variables", "effect")
PROBLEM_KEYS = (
    "problem", "parameters", "variables", "costs", "propagation", "limits", "grouping", "effect",
)  # fmt: skip


def _by_model(section: Section, count: int) -> Recipe | None:
    found = _configured(section, MODEL_KEYS)
    section.known(["at", "output", "statistic", "level", "threshold", "units", "derivative"])
    if found is None:
        return None
    kind = registry.load("models", found.model_name)
    at = _points(section.section("at"), kind)
    drawn = section.integer("units", Range(low=2)) or 0
    statistic = _statistic(section, drawn, max((len(one) for one in at.values()), default=1))
    if kind.population and not drawn:
        section.fault("units", f"is missing: {found.model_name} draws units; say how many")
    names = _names(section, "output", count, {one.name: one.unit for one in kind.outputs})
    recipe = ByModel(
        found.model_name, kind, **arguments_of(found), effects=found.settings.effects, at=at,
        outputs=names, statistic=statistic, drawn=drawn,
    )  # fmt: skip
    _tried(section, recipe.model)
    return recipe


def _points(section: Section, kind: Any) -> dict[str, tuple[float, ...]]:
    """The operating points: one value for all, or lists of one length."""
    found = {}
    for column in kind.columns:
        if column.text:
            continue
        if isinstance(section.take(column.name), list):
            values = section.numbers(column.name)
        else:
            value = section.quantity(column.name, column.unit)
            values = None if value is None else (value,)
        if values:
            found[column.name] = values
        elif column.needed and column.name not in section:
            section.fault(column.name, f"is missing: {column.meaning}")
    section.finish()
    lengths = {len(values) for values in found.values()} - {1}
    if len(lengths) > 1:
        section.fault("", f"has lists of different lengths: {sorted(lengths)}")
    return found


def _statistic(section: Section, drawn: int, rows: int) -> Statistic:
    name = section.text("statistic", STATISTICS) or "value"
    level = section.number("level", within=LEVEL)
    threshold = section.number("threshold")
    if name == "quantile" and "level" not in section:
        section.fault("level", "is missing: the share of rows below the quantile")
    if name.startswith("fraction") and "threshold" not in section:
        section.fault("threshold", "is missing: the value, in the unit of the output")
    if name == "value" and (drawn or rows > 1):
        section.fault("statistic", f"is missing: there are {drawn or rows} rows; choose one of "
                      f"{', '.join(STATISTICS[1:])}")  # fmt: skip
    return Statistic(name, (level if name == "quantile" else threshold) or 0.0)


def _by_problem(section: Section, count: int) -> Recipe | None:
    found = _configured(section, PROBLEM_KEYS)
    section.known(["reference", "design", "output", "derivative"])
    if found is None or found.problem is None:
        return None
    problem = found.problem
    known = {one.name: one.unit for one in problem.outputs}
    names = _names(section, "output", count, known)
    printed = problem.references()
    label = section.text("reference", printed)
    own = {v.name: v.document for v in problem.variables if v.document is not None} | problem.fixed
    if label is not None and label in printed:
        own |= dict(zip(problem.names, printed[label].tolist(), strict=True))
    design = section.section("design")
    for variable in problem.variables:
        within = Range(variable.valid_low, variable.valid_high)
        value = design.number(variable.name, variable.unit, within)
        if value is not None:
            own[variable.name] = value
        elif variable.name not in own and variable.name not in design:
            design.fault(variable.name, "is missing: no document prints it")
    design.finish()
    if len(own) < len(problem.variables):
        return None
    return ByProblem(
        found.problem_name, problem, tuple(float(own[name]) for name in problem.names), names
    )


def _by_formula(section: Section, count: int, unit: str, study: str) -> Recipe | None:
    value = section.take("formula")
    texts = [value] if isinstance(value, str) else section.names("formula") or []
    if count and texts and len(texts) != count:
        section.fault("formula", f"must be {count} as `printed` has, got {len(texts)}")
    formulas = []
    for text in texts:
        try:
            formulas.append(Formula(text))
        except FormulaError as error:
            section.fault("formula", f'"{text}": {error}')
    terms = _terms(section, study)
    used = {name for formula in formulas for name in formula.names}
    table = section.section("terms")
    for name in sorted(used - set(table.given())):
        section.fault("formula", f'"{name}" is no term{nearest(name, table.given())}')
    for name in sorted(set(table.given()) - used):
        table.fault(name, "is used by no formula")
    complete = len(formulas) == len(texts) and used <= set(terms)
    return ByFormula(tuple(formulas), terms, unit) if complete and texts else None


def _terms(section: Section, study: str) -> dict[str, tuple[Recipe, str]]:
    """The terms: a printed number with its unit, or a recipe and the unit in which it enters."""
    table = section.section("terms")
    found = {}
    for name in table.given():
        if not isinstance(table.take(name), dict):
            table.fault(name, 'must be a table: { value = 1.0, unit = "mm" }, or a recipe')
            continue
        own = table.section(name)
        unit = own.text("unit")
        if not unit:
            own.fault("unit", 'is missing: the unit in which it enters the formula, "1" for none')
        recipe = _constant(own, unit or "1") if "value" in own else _term(own, study)
        own.finish()
        if recipe is not None and unit:
            _convertible(own, recipe, unit)
            found[name] = (recipe, unit)
    return found


def _constant(section: Section, unit: str) -> Recipe | None:
    value = section.number("value", "" if unit == "1" else unit)
    return None if value is None else Constant(value, unit)


def _term(section: Section, study: str) -> Recipe | None:
    return _derived(section, _recipe(section, 1, study, "1"))


def _derived(section: Section, recipe: Recipe | None) -> Recipe | None:
    """The derivative of the recipe where one is asked for."""
    if "derivative" not in section:
        return recipe
    own = section.section("derivative")
    name, step = own.text("by"), own.number("step", within=POSITIVE)
    for key in ("by", "step"):
        if key not in own:
            own.fault(key, "is missing: a derivative needs what it is by, and a step")
    own.finish()
    if recipe is None or name is None or step is None:
        return None
    known = recipe.shiftable()
    if recipe.unit_of(name) is None:
        own.fault("by", f'"{name}" is no input of {recipe.by}{nearest(name, known)}; known: '
                  f"{', '.join(known)}")  # fmt: skip
        return None
    derived = Derivative(recipe, name, step)
    for sign in (-1.0, 1.0):
        _tried(own, partial(recipe.shifted, name, sign * step))
    return derived


def _tried(section: Section, build: Callable[[], object]) -> None:
    """Report what is wrong with something that can only be told by building it."""
    try:
        build()
    except InputError as error:
        for fault in error.faults:
            section.fault(fault.place, fault.message)


def _convertible(section: Section, recipe: Recipe, unit: str) -> None:
    """Report values whose unit, as far as it is known, cannot be stated in that of the claim."""
    for own in _units(recipe):
        try:
            converted(1.0, "" if own == "1" else own, "" if unit == "1" else unit)
        except ValueError as error:
            section.fault("", f"{recipe.by}: {error}")


def _units(recipe: Recipe) -> tuple[str, ...]:
    """Units of the values of a recipe, those that are known before it computes."""
    match recipe:
        case Derivative():
            per = recipe.recipe.unit_of(recipe.name) or "1"
            return tuple(one if per == "1" else f"({one})/({per})" for one in _units(recipe.recipe))
        case Constant():
            return (recipe.unit,)
        case ByCalculation():
            known = {one.name: one.unit for one in recipe.kind.outputs}
            return tuple(known[name] or "1" for name in recipe.quantities if name in known)
        case ByModel():
            outputs = {one.name: one.unit for one in recipe.kind.outputs}
            return tuple(
                recipe.statistic.unit(outputs[name]) or "1" for name in recipe.outputs
                if name in outputs
            )  # fmt: skip
        case ByProblem():
            units = {one.name: one.unit for one in recipe.problem.outputs}
            return tuple(units[name] or "1" for name in recipe.outputs if name in units)
        case _:
            return ()
