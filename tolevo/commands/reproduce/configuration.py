"""Reads files of claims: everything is checked before anything is computed."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from decimal import Decimal, InvalidOperation
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

from ... import registry
from ...configuration.configuration import Configuration
from ...configuration.parameters import read_parameters
from ...configuration.plugins import ModelClass, load_named
from ...configuration.reader import arguments_of, read_table
from ...configuration.source import Table, load, override
from ...errors import Fault, nearest, raise_all
from ...models.expressions import Formula, FormulaError
from ...section import POSITIVE, SAMPLES, Range, Section, shown
from ...units import converted, dimension
from .claims import RELATIONS, Claim, ClaimsFile, Interpretation, ReproducePlan, Source
from .recipes import STATISTICS, ByCalculation, ByFormula, ByModel, ByProblem, Constant, Derivative, Recipe, Statistic
from .records import Document

# Parts common to all methods to recompute a claim: names, tables of configurations, units.


def names_of(section: Section, key: str, count: int, known: Mapping[str, Any]) -> tuple[str, ...]:
    """A name, or as many names as the claim prints; all must be in `known`, if given."""
    value = section.take(key)
    names = [value] if isinstance(value, str) else section.names(key)
    if names is None:
        if value is None:
            section.fault(key, "is missing: name the quantity that is compared with the printed value")
        return ()
    if count and len(names) != count:
        section.fault(key, f"must name {count} as `printed` does, got {len(names)}")
    for name in names:
        if known and name not in known:
            section.fault(key, f'"{name}" is not computed{nearest(name, known)}; known: {", ".join(known)}')
    return tuple(names)


def configured(section: Section, keys: tuple[str, ...]) -> Configuration | None:
    """The configuration in some keys of an interpretation; its faults are placed in the latter."""
    table = {key: section.take(key) for key in keys if key in section}
    return section.attempt(lambda: read_table(table, []))


def convertible(section: Section, recipe: Recipe, unit: str) -> None:
    """Report values whose unit, as far as it is known, cannot be stated in that of the claim."""
    for recipe_unit in units_of(recipe):
        try:
            converted(1.0, "" if recipe_unit == "1" else recipe_unit, "" if unit == "1" else unit)
        except ValueError as error:
            section.fault("", f"{recipe.by}: {error}")


def units_of(recipe: Recipe) -> tuple[str, ...]:
    """Units of the values of a recipe, those that are known before it computes."""
    match recipe:
        case Derivative():
            per = recipe.recipe.unit_of(recipe.name) or "1"
            return tuple(unit if per == "1" else f"({unit})/({per})" for unit in units_of(recipe.recipe))
        case Constant():
            return (recipe.unit,)
        case ByCalculation():
            known = {output.name: output.unit for output in recipe.kind.outputs}
            return tuple(known[name] or "1" for name in recipe.quantities if name in known)
        case ByModel():
            outputs = {output.name: output.unit for output in recipe.kind.outputs}
            return tuple(recipe.statistic.unit(outputs[name]) or "1" for name in recipe.outputs if name in outputs)
        case ByProblem():
            units = {output.name: output.unit for output in recipe.problem.outputs}
            return tuple(units[name] or "1" for name in recipe.outputs if name in units)
        case _:
            return ()


# Interpretations of claims (`[[claim.reading]]`) by models and problems.


LEVEL = Range(0.0, 1.0, open_low=True, open_high=True)
MODEL_KEYS = ("model", "parameters", "variables", "effect")
PROBLEM_KEYS = ("problem", "parameters", "variables", "costs", "propagation", "limits", "grouping", "effect")


def read_model_statistic(section: Section, count: int) -> Recipe | None:
    """A statistic of a model's outputs; None where the model cannot be set up."""
    configuration = configured(section, MODEL_KEYS)
    section.accept(["at", "output", "statistic", "level", "threshold", "units", "derivative"])
    if configuration is None:
        return None
    kind = registry.load("models", configuration.model_name)
    at = _points(section.section("at"), kind)
    drawn = section.integer("units", Range(low=2), SAMPLES) or 0
    statistic = _statistic(section, drawn, max((len(points) for points in at.values()), default=1))
    if kind.population and not drawn:
        section.fault("units", f"is missing: {configuration.model_name} draws units; state their number")
    names = names_of(section, "output", count, {output.name: output.unit for output in kind.outputs})
    recipe = ByModel(
        configuration.model_name,
        kind,
        **arguments_of(configuration),
        effects=configuration.settings.effects,
        at=at,
        outputs=names,
        statistic=statistic,
        drawn=drawn,
    )
    section.attempt(recipe.model)  # reports faults that only show when the model is built
    return recipe


def _points(section: Section, kind: ModelClass) -> dict[str, tuple[float, ...]]:
    """The operating points: one value for all, or lists of one length."""
    points = {}
    for column in kind.columns:
        if column.text:
            continue
        if isinstance(section.take(column.name), list):
            values = section.numbers(column.name)
        else:
            value = section.quantity(column.name, column.unit)
            values = None if value is None else (value,)
        if values:
            points[column.name] = values
        elif column.needed and column.name not in section:
            section.fault(column.name, f"is missing: {column.meaning}")
    section.finish()
    lengths = {len(values) for values in points.values()} - {1}
    if len(lengths) > 1:
        section.fault("", f"has lists of different lengths: {sorted(lengths)}")
    return points


def _statistic(section: Section, drawn: int, rows: int) -> Statistic:
    name = section.text("statistic", STATISTICS) or "value"
    level = section.number("level", within=LEVEL)
    threshold = section.number("threshold")
    if name == "quantile" and "level" not in section:
        section.fault("level", "is missing: the fraction of rows below the quantile")
    if name.startswith("fraction") and "threshold" not in section:
        section.fault("threshold", "is missing: the value, in the unit of the output")
    if name == "value" and (drawn or rows > 1):
        section.fault(
            "statistic", f"is missing: there are {drawn or rows} rows; choose one of {', '.join(STATISTICS[1:])}"
        )
    return Statistic(name, (level if name == "quantile" else threshold) or 0.0)


def read_problem_outputs(section: Section, count: int) -> Recipe | None:
    """Outputs of a problem at a design; None where problem or design are faulty."""
    configuration = configured(section, PROBLEM_KEYS)
    section.accept(["reference", "design", "output", "derivative"])
    if configuration is None or configuration.problem is None:
        return None
    problem = configuration.problem
    names = names_of(section, "output", count, {output.name: output.unit for output in problem.outputs})
    printed = problem.references()
    label = section.text("reference", printed)
    values = {v.name: v.document for v in problem.variables if v.document is not None} | problem.fixed
    if label is not None and label in printed:
        values |= dict(zip(problem.names, printed[label].tolist(), strict=True))
    design = section.section("design")
    for variable in problem.variables:
        value = design.number(variable.name, variable.unit, Range(variable.valid_low, variable.valid_high))
        if value is not None:
            values[variable.name] = value
        elif variable.name not in values and variable.name not in design:
            design.fault(variable.name, "is missing: no document prints it")
    design.finish()
    if len(values) < len(problem.variables):
        return None
    return ByProblem(configuration.problem_name, problem, tuple(float(values[name]) for name in problem.names), names)


# `[[claim.reading]]`: how a value is recomputed.


KINDS = ("calculation", "model", "problem", "formula")
STUDY = "study"
"""Parameter of a calculation that may read the result of a study."""


def read_recipe(section: Section, count: int, unit: str, study: str) -> Recipe | None:
    """The recipe of an interpretation of a claim in `unit`; None where it is faulty."""
    derived = _read_derivative(section, _recipe(section, count, study, unit))
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
            return _read_calculation(section, count, study)
        case "model":
            return read_model_statistic(section, count)
        case "problem":
            return read_problem_outputs(section, count)
        case _:
            return _read_formula(section, count, unit, study)


def _read_calculation(section: Section, count: int, study: str) -> Recipe | None:
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


def _read_formula(section: Section, count: int, unit: str, study: str) -> Recipe | None:
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
        recipe = (
            _constant(term, unit or "1") if "value" in term else _read_derivative(term, _recipe(term, 1, study, "1"))
        )
        term.finish()
        if recipe is not None and unit:
            convertible(term, recipe, unit)
            terms[name] = (recipe, unit)
    return terms


def _constant(section: Section, unit: str) -> Recipe | None:
    value = section.number("value", "" if unit == "1" else unit)
    return None if value is None else Constant(value, unit)


def _read_derivative(section: Section, recipe: Recipe | None) -> Recipe | None:
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
    known = tuple(recipe.shift_units())
    if recipe.unit_of(name) is None:
        text = f'"{name}" is not an input of {recipe.by}{nearest(name, known)}; known: {", ".join(known)}'
        derivative.fault("by", text)
        return None
    derived = Derivative(recipe, name, step)
    for sign in (-1.0, 1.0):
        derivative.attempt(partial(recipe.shifted, name, sign * step))
    return derived


SHIPPED = "claims_*.toml"
HALF_UNIT = "half a unit of the last printed digit"


def shipped_claims() -> tuple[Path, ...]:
    """The files of claims that come with the package, by name."""
    return tuple(sorted(Path(str(files("tolevo.configs"))).glob(SHIPPED)))


def read_claims(paths: Sequence[Path], overrides: Sequence[str] = ()) -> ReproducePlan:
    """The claims in TOML files (those shipped where none is named), `key=value` applied to each.

    Raises InputError with every fault of every file.
    """
    faults: list[Fault] = []
    read = {path: _source(path, overrides, faults) for path in (paths or shipped_claims())}
    sources = {path: source for path, source in read.items() if source is not None}
    names: list[str] = []
    for path, source in sources.items():
        name = source.file.document.name
        if name in names:
            faults.append(Fault(f"{path.name}: document", f'"{name}" is read twice'))
        names.append(name)
    raise_all(faults)
    return ReproducePlan(tuple(sources.values()))


def _source(path: Path, overrides: Sequence[str], faults: list[Fault]) -> Source | None:
    """One file; its faults bear its name."""
    file_faults: list[Fault] = []
    table = load(path, faults)
    if table is None:
        return None
    override(table, overrides, file_faults)
    claims_file = _file(table, file_faults)
    if not file_faults and not claims_file.claims:
        file_faults.append(Fault("claim", "is missing: write a table [[claim]] for each printed figure"))
    faults += [Fault(f"{path.name}: {fault.place}", fault.message) for fault in file_faults]
    return Source(claims_file, json.dumps(table, sort_keys=True, default=str))


def _file(table: Table, faults: list[Fault]) -> ClaimsFile:
    top = Section(table, "", faults)
    document = Document(_required_text(top, "document"), _required_text(top, "title"), top.text("reference") or "")
    seed = top.integer("seed", Range(low=0), None)
    study = top.text("study") or ""
    positions: dict[str, int] = {}
    claims = []
    for at, claim_table in enumerate(top.tables("claim")):
        section = _place_claim(top, claim_table, at)
        name = section.text("id")
        if not name:
            section.fault("id", "is missing: name the claim")
        elif name in positions:
            section.fault("id", f'"{name}" is also the id of claim[{positions[name]}]')
        positions[name or f"[{at}]"] = at
        claim = _claim(section, name or "", study)
        if claim is not None:
            claims.append(claim)
    top.finish()
    return ClaimsFile(document, 0 if seed is None else seed, tuple(claims))


def _place_claim(top: Section, table: Table | Any, at: int) -> Section:
    """The claim number `at`; its place holds its id, by which a reader finds it."""
    name = table.get("id")
    return top.of(f"claim[{at}] ({name})" if isinstance(name, str) else f"claim[{at}]", table)


def _required_text(section: Section, key: str, remedy: str = "") -> str:
    """A text that must be there."""
    value = section.text(key)
    if (value is None and key not in section) or (value is not None and not value.strip()):
        section.fault(key, f"is missing{remedy}")
    return value or ""


def _claim(section: Section, name: str, study: str) -> Claim | None:
    """A claim, None where it is so faulty that it cannot be tested."""
    place, quantity = _required_text(section, "place"), _required_text(section, "quantity")
    unit = _unit(section)
    relation = section.text("relation", RELATIONS) or "equal"
    printed, step = _printed(section)
    tolerance, reason = _tolerance(section, relation, step)
    lost = section.text("lost") or ""
    printed_as, ambiguous, why = (section.text(key) or "" for key in ("printed_as", "ambiguous", "why"))
    section.accept(["reading"])
    readings = _read_interpretations(section, unit, relation, len(printed), study)
    if lost and "reading" in section:
        section.fault("reading", "computes what `lost` states to be impossible; give only one of them")
    elif not lost and "reading" not in section:
        section.fault("reading", "is missing: state how it is recomputed ([[claim.reading]]), or what is lost")
    elif not lost and "printed" not in section:
        section.fault("printed", "is missing: the number that the document prints")
    section.finish()
    return Claim(
        name, place, quantity, unit, printed, printed_as, relation, tolerance, reason, ambiguous, lost, why, readings
    )


def _unit(section: Section) -> str:
    unit = _required_text(section, "unit", ': write the unit of the printed value, "1" where it has none')
    if unit:
        try:
            dimension(unit)
        except ValueError as error:
            section.fault("unit", str(error))
            return ""
    return unit


def _printed(section: Section) -> tuple[tuple[float, ...], float]:
    """The printed numbers, and half a unit of the last digit of the coarsest of them."""
    value = section.take("printed")
    if value is None:
        return (), 0.0
    entries = value if isinstance(value, list) else [value]
    numbers, steps = [], []
    for at, entry in enumerate(entries):
        number = _digits(entry)
        if number is None:
            text = f'must be a number, or its digits as a string ("0.110"), got {shown(entry)}'
            section.fault(f"printed[{at}]" if isinstance(value, list) else "printed", text)
            continue
        numbers.append(float(number))
        steps.append(0.5 * 10.0 ** int(number.as_tuple().exponent))
    if not entries:
        section.fault("printed", "must hold at least one number")
    return tuple(numbers), max(steps, default=0.0)


def _digits(value: Any) -> Decimal | None:
    """A finite number with the digits in which it is written, None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        number = Decimal(str(value))
    except InvalidOperation:
        return None
    if not number.is_finite():
        return None
    return Decimal(int(value)) if isinstance(value, float) and value == int(value) else number


def _tolerance(section: Section, relation: str, step: float) -> tuple[float, str]:
    """The tolerance and its reason: by default that of rounding, of an equality alone."""
    tolerance = section.number("tolerance", within=Range(low=0.0))
    reason = section.text("tolerance_reason")
    if "tolerance" in section and not (reason or "").strip():
        section.fault("tolerance_reason", "is missing: a tolerance needs its justification")
    elif reason and "tolerance" not in section:
        section.fault("tolerance", "is missing: tolerance_reason justifies nothing")
    if relation in ("above", "below") and "tolerance" in section:
        section.fault("tolerance", f'has no meaning with relation = "{relation}"')
    if tolerance is not None:
        return tolerance, reason or ""
    return (step, HALF_UNIT) if relation == "equal" and step else (0.0, "")


def _read_interpretations(
    section: Section, unit: str, relation: str, count: int, study: str
) -> tuple[Interpretation, ...]:
    """How the claim is recomputed; every interpretation but the first states what it assumes."""
    if relation == "within" and count != 2:
        section.fault("printed", f"must be [low, high] where the relation is within, got {count}")
    wanted = 1 if relation == "within" else count
    interpretations = []
    for at, reading in enumerate(section.items("reading")):
        states = reading.text("states") or ""
        if at and not states.strip():
            reading.fault("states", "is missing: only the first interpretation may be the literal one")
        recipe = read_recipe(reading, wanted, unit, study)
        reading.finish()
        if recipe is not None:
            interpretations.append(Interpretation(recipe, states))
    return tuple(interpretations)
