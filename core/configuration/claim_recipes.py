"""`[[claim.reading]]`: how a value is recomputed."""

from __future__ import annotations

from functools import partial

from ..errors import nearest
from ..models.expressions import Formula, FormulaError
from ..section import POSITIVE, Section
from ..workflows.reproduce.recipes import ByCalculation, ByFormula, Constant, Derivative, Recipe
from .claim_models import by_model, by_problem
from .claim_parts import convertible, names_of
from .parameters import read_parameters
from .plugins import load_named

KINDS = ("calculation", "model", "problem", "formula")
STUDY = "study"
"""Parameter of a calculation that may read the result of a study."""


def read_recipe(section: Section, count: int, unit: str, study: str) -> Recipe | None:
    """The recipe of an interpretation of a claim in `unit`; None where it is faulty."""
    derived = _derived(section, _recipe(section, count, study, unit))
    if derived is not None and unit:
        convertible(section, derived, unit)
    return derived


def _recipe(section: Section, count: int, study: str, unit: str = "") -> Recipe | None:
    """A recipe of `count` values; `unit` is that of a formula's results."""
    kinds = [kind for kind in KINDS if kind in section]
    if len(kinds) != 1:
        section.fault("", f"must have exactly one of the keys {', '.join(KINDS)}, got {' and '.join(kinds) or 'none'}")
        section.accept(section.all_keys())
        return None
    match kinds[0]:
        case "calculation":
            return _by_calculation(section, count, study)
        case "model":
            return by_model(section, count)
        case "problem":
            return by_problem(section, count)
        case _:
            return _by_formula(section, count, unit, study)


def _by_calculation(section: Section, count: int, study: str) -> Recipe | None:
    kind = load_named(section, "calculation", "calculations")
    if kind is None:
        section.accept(["quantity", "parameters", "derivative"])
        return None
    names = names_of(section, "quantity", count, {output.name: output.unit for output in kind.outputs})
    parameters = read_parameters(section.section("parameters"), kind.parameters)
    if study and any(parameter.name == STUDY for parameter in kind.parameters):
        parameters.setdefault(STUDY, study)
    for fault in kind().faults(kind().completed(parameters)):
        section.fault(f"parameters.{fault.place}", fault.message)
    return ByCalculation(kind, tuple(parameters.items()), names, section.place("quantity"))


def _by_formula(section: Section, count: int, unit: str, study: str) -> Recipe | None:
    value = section.take("formula")
    texts = [value] if isinstance(value, str) else section.names("formula") or []
    if count and texts and len(texts) != count:
        section.fault("formula", f"must hold {count} formulas, as many as `printed` has numbers, got {len(texts)}")
    formulas = []
    for text in texts:
        try:
            formulas.append(Formula(text))
        except FormulaError as error:
            section.fault("formula", f'"{text}": {error}')
    terms = _terms(section, study)
    used = {name for formula in formulas for name in formula.names}
    table = section.section("terms")
    for name in sorted(used - set(table.all_keys())):
        section.fault("formula", f'"{name}" is not a term{nearest(name, table.all_keys())}')
    for name in sorted(set(table.all_keys()) - used):
        table.fault(name, "is used by no formula")
    complete = len(formulas) == len(texts) and used <= set(terms)
    return ByFormula(tuple(formulas), terms, unit) if complete and texts else None


def _terms(section: Section, study: str) -> dict[str, tuple[Recipe, str]]:
    """The terms: a printed number with its unit, or a recipe and the unit in which it enters."""
    table = section.section("terms")
    terms = {}
    for name in table.all_keys():
        if not isinstance(table.take(name), dict):
            table.fault(name, 'must be a table: { value = 1.0, unit = "mm" }, or a recipe')
            continue
        term = table.section(name)
        unit = term.text("unit")
        if not unit:
            term.fault("unit", 'is missing: the unit in which it enters the formula, "1" for none')
        recipe = _constant(term, unit or "1") if "value" in term else _derived(term, _recipe(term, 1, study, "1"))
        term.finish()
        if recipe is not None and unit:
            convertible(term, recipe, unit)
            terms[name] = (recipe, unit)
    return terms


def _constant(section: Section, unit: str) -> Recipe | None:
    value = section.number("value", "" if unit == "1" else unit)
    return None if value is None else Constant(value, unit)


def _derived(section: Section, recipe: Recipe | None) -> Recipe | None:
    """The derivative of the recipe, where the table states one."""
    if "derivative" not in section:
        return recipe
    derivative = section.section("derivative")
    name, step = derivative.text("by"), derivative.number("step", within=POSITIVE)
    for key in ("by", "step"):
        if key not in derivative:
            derivative.fault(key, "is missing: a derivative needs the input that is varied, and a step")
    derivative.finish()
    if recipe is None or name is None or step is None:
        return None
    known = recipe.shiftable()
    if recipe.unit_of(name) is None:
        text = f'"{name}" is not an input of {recipe.by}{nearest(name, known)}; known: {", ".join(known)}'
        derivative.fault("by", text)
        return None
    derived = Derivative(recipe, name, step)
    for sign in (-1.0, 1.0):
        derivative.attempt(partial(recipe.shifted, name, sign * step))
    return derived
