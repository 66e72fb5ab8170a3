"""The inputs of the physical model: `[parameters]`, `[variables]` with their measured parts, `[[effect]]`,
`[[unresolved]]` and `[gear]`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import registry
from ..errors import nearest
from ..models.capability import PartSample, read_sample
from ..models.effects.effect import Effect, EffectParameter, Target
from ..models.effects.measurements import Active, target_of
from ..models.effects.unresolved import SHAPES, Term, Unresolved, unresolved_of
from ..models.gear import BUILD, DECLARED, TEETH, Gear, contradictions
from ..models.input_reading import keys, read_distribution
from ..models.inputs import Distribution, Zone
from ..models.measurable import MeasurableModel
from ..problems.settings import VariableSetting
from ..registry import PLUGIN_FAULTS
from ..section import PLAIN, TOLERANCES, Kind, Parameter, Range, Section, Value, Variable, shown
from ..units import split_unit, unit_hint
from .plugins import ModelClass, load_named

if TYPE_CHECKING:
    from ..models.effects.formula import OfFormula


def read_parameters(section: Section, declared: Iterable[Parameter]) -> dict[str, Value]:
    """The parameters that the configuration sets."""
    values = {parameter.name: _read(section, parameter) for parameter in declared}
    section.finish()
    return {name: value for name, value in values.items() if value is not None}


def _read(section: Section, parameter: Parameter) -> Value | None:
    within = Range(parameter.low, parameter.high, open_low=parameter.open_low)
    match parameter.default:
        case bool():
            return section.flag(parameter.name)
        case str():
            return section.text(parameter.name, parameter.choices)
        case int() if not parameter.unit:
            return section.integer(parameter.name, within, parameter.need or PLAIN)
        case tuple():
            return _list(section, parameter, len(parameter.default), within)
        case Mapping():
            return _table(section, parameter, within)
        case _:
            return section.quantity(parameter.name, parameter.unit, within)


def _list(section: Section, parameter: Parameter, count: int, within: Range) -> tuple[float, ...] | None:
    """Exactly `count` numbers (0: any count, which the model checks) in the unit of the parameter, or strings
    with a unit.
    """
    value = section.take(parameter.name)
    if value is None:
        return None
    if not isinstance(value, list) or (count and len(value) != count):
        stated = f"{len(value)} of them" if isinstance(value, list) else shown(value)
        section.fault(parameter.name, f"must be a list of {f'{count} ' * bool(count)}numbers, got {stated}")
        return None
    name, unit = parameter.name, parameter.unit
    checked = [section.as_number(f"{name}[{i}]", entry, unit, within) for i, entry in enumerate(value)]
    numbers = tuple(number for number in checked if number is not None)
    return numbers if len(numbers) == len(value) else None


def _table(section: Section, parameter: Parameter, within: Range) -> dict[str, float] | None:
    """Numbers by name, each name one of the parameter's choices."""
    if parameter.name not in section:
        return None
    table = section.section(parameter.name)
    numbers = {name: table.quantity(name, split_unit(name)[1], within) for name in parameter.choices}
    table.finish()
    return {name: value for name, value in numbers.items() if value is not None}


# `[variables.<name>.measured]`: what measured parts say about a variable.


BOUNDS = ("value", "low", "high", "limits", "mid")
"""Keys that a variable with a measured standard deviation may not have."""


def read_measured(section: Section, variable: Variable, mid: float | None, t: float | None) -> PartSample | None:
    """The `measured` table of a variable of a half-width or standard deviation; None where there is
    none, or after a fault.

    `mid` is its mid-limit, `t` the half-width where it is fixed. The sample gives
    the distribution of a half-width, or the value of a standard deviation.
    """
    if "measured" not in section or "machine" in section:  # next to machines it is a fault already
        section.accept(("measured",))
        return None
    deviates = variable.kind is Kind.STANDARD_DEVIATION
    if not deviates and not (variable.random and variable.kind is Kind.HALF_WIDTH):
        section.take("measured")
        text = f"{variable.name} ({variable.kind}) takes no measured parts"
        section.fault("measured", f"{text}: half-widths with a distribution and standard deviations do")
        return None
    stated = [key for key in (BOUNDS if deviates else keys()) if key in section]
    for key in stated:
        section.fault(key, "is stated in addition to measured, from which it follows: keep only one of them")
    if mid is None and (single := [key for key in ("lower", "upper") if key in section.section("measured")]):
        text = f"has one limit ({single[0]}), and errors of {variable.name} count as centred between two"
        section.fault("measured.file", f"{text}: state a distribution of them instead")
        section.accept(("measured",))
        return None
    sample = read_sample(section, variable.unit, None, mid or 0.0, t, follows=not deviates)
    if sample is None or stated:
        return None
    if sample.offset and mid is None:
        section.fault(
            "measured.mean",
            f'must be "corrected": errors of {variable.name} have no mid-limit here and count as centred, and the '
            f"sample is {sample.offset:+.4g} {variable.unit} off",
        )
        return None
    return sample


# `[variables.<name>]`: what is fixed, what is searched, and how it is distributed.


def read_variable(section: Section, variable: Variable, parameters: Mapping[str, Value]) -> Any:
    """The `VariableSetting` that a table states, None where it states nothing."""
    value, low, high = (_bound(section, variable, key) for key in ("value", "low", "high"))
    mid = _mid(section, variable)
    zone = _zone(section, variable)
    if zone is not None:
        value, mid = zone.half_width, zone.mid
        _is_outside(section, variable, "limits", value)
    elif "value" in section and ("low" in section or "high" in section):
        section.fault("", "give either value or low and high, not both")
    elif "value" not in section:
        _order(section, variable, low, high)
    mid = _agree_on_mid_limit(section, variable, mid, parameters)
    law = _distribution(section, variable)
    middle = variable.mid if mid is None else mid
    sample = read_measured(section, variable, middle, value)
    if sample is not None and variable.random:
        law, mid = sample.distribution, middle
    elif sample is not None:
        value = sample.knowledge.std
        _is_outside(section, variable, "measured", value)
    setting = VariableSetting(value, low, high, law, mid, sample)
    section.finish()
    return None if setting == VariableSetting() else setting


def mid_parameter(variable: str) -> str:
    """Name of the parameter that holds the mid-limit of a variable."""
    return "{}_mid_{}".format(*split_unit(variable))


def _bound(section: Section, variable: Variable, key: str) -> float | None:
    number = section.number(key, variable.unit)
    return None if number is None or _is_outside(section, variable, key, number) else number


def _is_outside(section: Section, variable: Variable, key: str, number: float) -> bool:
    least = max(variable.valid_low, 0.0) if variable.kind in TOLERANCES else variable.valid_low
    complaint = Range(least, variable.valid_high).complaint(number)
    if variable.integer and not number.is_integer():
        complaint = f"must be a whole number, got {number}"
    if complaint:
        section.fault(key, complaint + unit_hint(number, variable.unit, variable.low, variable.high))
    return bool(complaint)


def _order(section: Section, variable: Variable, low: float | None, high: float | None) -> None:
    """A range that is reversed or empty; an end that is not given is the problem's own."""
    least = variable.low if low is None else low
    most = variable.high if high is None else high
    if least >= most and not (low is None and high is None):
        fixed = f"; a variable that is not searched has value = {least:g}" if least == most else ""
        section.fault("low", f"must be below high ({most:g}), got {least:g}{fixed}")


def _mid(section: Section, variable: Variable) -> float | None:
    mid = section.number("mid", variable.unit)
    if "mid" in section and variable.mid is None:
        section.fault("mid", f"{variable.name} ({variable.kind}) has no mid-limit")
        return None
    return mid


def _zone(section: Section, variable: Variable) -> Zone | None:
    text = section.text("limits")
    if text is None:
        return None
    if variable.kind is not Kind.HALF_WIDTH:
        section.fault("limits", f"do not apply to a {variable.kind}: give value")
        return None
    if conflicting := [key for key in ("value", "low", "high", "mid") if key in section]:
        section.fault("limits", f"set value and mid: leave out {', '.join(conflicting)}")
        return None
    try:
        zone = Zone.of_text(text)
    except ValueError as error:
        section.fault("limits", str(error))
        return None
    if not (math.isfinite(zone.mid) and math.isfinite(zone.half_width)):
        section.fault("limits", f'must be finite, got "{text}"')
        return None
    return zone


def _agree_on_mid_limit(
    section: Section, variable: Variable, mid: float | None, parameters: Mapping[str, Value]
) -> float | None:
    """The mid-limit; `[parameters]` may state it as well, or instead."""
    name = mid_parameter(variable.name)
    parameter = parameters.get(name)
    if not isinstance(parameter, int | float) or isinstance(parameter, bool) or variable.mid is None:
        return mid
    if mid is not None and not math.isclose(mid, parameter, rel_tol=1e-9, abs_tol=1e-12):
        key = "mid" if "mid" in section else "limits"
        section.fault(key, f"differs from parameters.{name}: {mid:g} here, {parameter:g} there")
    return float(parameter) if mid is None else mid


def _distribution(section: Section, variable: Variable) -> Distribution | None:
    if not variable.random:
        for key in keys():
            if section.take(key) is not None:
                section.fault(key, f"{variable.name} ({variable.kind}) has no distribution to set")
        return None
    law = read_distribution(section)
    if law is None or not law.one_sided:
        return law
    radius = "is a radius, from mid to mid + t"
    if variable.kind is not Kind.HALF_WIDTH:
        section.fault("distribution", f"{radius}: it does not apply to a {variable.kind}")
    elif "limits" in section:
        section.fault("limits", f"do not apply: the input {radius}. Give value and mid")
    return law


# `[[unresolved]]`: smooth terms of the corrected model that no effect of the library explains.


UNRESOLVED = "unresolved"
TEXTS, FLAGS = ("output", "variable", "shape", "times"), ("signed", "turns", "times_magnitude")
LISTS = ("knots", "heights", "radii", "coefficients", "labels")


def read_unresolved(top: Section, model: ModelClass | MeasurableModel | None, name: str) -> tuple[Active, ...]:
    """The terms in the model `name`, of the class `model` (None where it is not known)."""
    sections = top.items(UNRESOLVED)
    terms = [_term(section) for section in sections]
    if model is None:
        return ()
    target = target_of(model, name) if sections else None
    for section, term in zip(sections, terms, strict=True):
        if term is not None and target is not None and not term.effect.own_applies(target):
            section.fault("variable", f"the model {name} lacks a column or the output of this term")
    return tuple(term for term in terms if term is not None)


def _term(section: Section) -> Active | None:
    """One table; None where it is at fault."""
    faulty = False
    for key in ("output", "variable", "shape", "coefficients"):
        if key not in section:
            section.fault(key, "is missing: a term has an output, a variable, a shape and coefficients")
            faulty = True
    term_table: dict[str, Any] = {}
    for key in (*(field.name for field in fields(Term)), "coefficients"):
        if key in section:
            value = _unresolved_value(section, key)
            faulty |= value is None
            term_table[key] = value
    if not faulty and len(term_table.get("heights", ())) != len(term_table.get("knots", ())) * (
        term_table["shape"] == "curve"
    ):
        section.fault("heights", "must have as many numbers as a curve has knots, and none for another shape")
        faulty = True
    for key in ("scale", "times_scale"):
        if term_table.get(key, 1.0) == 0.0:
            section.fault(key, "must not be 0: values are divided by it")
            faulty = True
    radii, plays = term_table.get("radii", []), term_table.get("shape") == "plays"
    if not faulty and (bool(radii) != plays or any(radius <= 0.0 for radius in radii)):
        section.fault("radii", "must be positive numbers, one for each of the plays, and none for another shape")
        faulty = True
    section.finish()
    if faulty:
        return None
    effect, values = unresolved_of(term_table)
    if len(values) != effect.term.count:
        section.fault("coefficients", f"are {len(values)}, but a {effect.term.shape} like this has {effect.term.count}")
        return None
    return Active(effect, values)


def _unresolved_value(section: Section, key: str) -> Any:
    if key == "shape":
        return section.text(key, SHAPES)
    if key in TEXTS:
        return section.text(key)
    if key in FLAGS:
        return section.flag(key)
    if key not in LISTS:
        return section.number(key, "")
    value = section.take(key)
    kinds, what = ((str,), "texts") if key == "labels" else ((int, float), "numbers")
    if not isinstance(value, list) or not all(type(entry) in kinds for entry in value):
        section.fault(key, f"must be a list of {what}, got {shown(value)}")
        return None
    return value if key == "labels" else [float(number) for number in value]


def resolved_unresolved(effects: Iterable[Active]) -> dict[str, list[Mapping[str, Any]]]:
    """The `[[unresolved]]` tables of the effects that are such terms; none where there is none."""
    tables: list[Mapping[str, Any]] = [
        active.effect.term.table(active.effect.coefficients(active.values))
        for active in effects
        if isinstance(active.effect, Unresolved)
    ]
    return {UNRESOLVED: tables} if tables else {}


# `[[effect]]`: the effects that are active in the model, with their parameters; by name, or by a formula.


FORMULA = "formula"


def read_effects(
    top: Section, model: ModelClass | MeasurableModel | None, name: str, of: Section | None = None
) -> tuple[Active, ...]:
    """The effects in the model `name`, of the class `model` (None where it is not known); `of` a condition,
    where it is given.
    """
    section = of or top
    sections = section.items("effect")
    if sections and model is None and not name:
        section.fault("effect", "needs a model: this problem has none that effects could act in")
    target = target_of(model, name) if sections and model is not None else None
    if target is not None and isinstance(model, type):  # it is not built yet: its parameters give its gear
        parameters = top.take("parameters")
        target = replace(target, gear=model.gear_of(parameters if isinstance(parameters, Mapping) else {}))
    effects = [_effect(section, target) for section in sections]
    return tuple(effect for effect in effects if effect is not None)


def _effect(section: Section, target: Target | None) -> Active | None:
    if "name" not in section:
        section.fault("name", "is missing: name an effect (see `tolevo list`)")
    if FORMULA in section:
        return _given_formula(section, target)
    kind = load_named(section, "name", "effects")
    parameters = section.section("parameters")
    section.finish()
    if kind is None or target is None:
        return None
    try:
        effect: Effect = kind()
    except PLUGIN_FAULTS as error:
        section.fault("name", f"{kind.__name__} cannot be made without arguments ({type(error).__name__}: {error})")
        return None
    if not effect.applies(target):
        section.fault("name", f'"{effect.name}" has no place in the model {target.model}: {effect.left_out(target)}')
        return None
    values = _values(parameters, effect, target)
    return Active(effect, values) if values is not None else None


LETTER = re.compile(r"[A-Za-z][0-9]*")
"""What may be a parameter of a formula: a letter, perhaps with a number."""


def _given_formula(section: Section, target: Target | None) -> Active | None:
    """An effect that a formula states, with its parameters."""
    parameters, effect = section.section("parameters"), formula_effect(section, target)
    section.finish()
    values = None if effect is None or target is None else _values(parameters, effect, target)
    return None if effect is None or values is None else Active(effect, values)


def formula_effect(section: Section, target: Target | None) -> OfFormula | None:
    """The effect of an `[[effect]]` table with a formula; None where it is at fault."""
    from ..models.effects.formula import OfFormula  # formulas are needed by few configurations
    from ..models.expressions import Formula, FormulaError

    name, text = section.text("name"), section.text(FORMULA)
    stated: dict[str, Any] = {key: section.take(key) for key in ("output", "bounds") if key in section}
    if name in registry.names("effects"):
        section.fault("name", f'"{name}" is an effect of the library: give the formula another name')
        return None
    try:
        formula = Formula(text or "")
    except FormulaError as error:
        section.fault(FORMULA, str(error))
        return None
    if target is None or not name:
        return None
    columns = sorted(column.name for column in target.columns if not column.text)
    other = [symbol for symbol in formula.names if symbol not in columns]
    effect = OfFormula(name, formula, tuple(symbol for symbol in other if LETTER.fullmatch(symbol)), stated)
    faults = [*_column_faults(effect, columns, target), *_letter_faults(effect)]
    for key, message in faults:
        section.fault(key, message)
    return None if faults else effect


def _column_faults(effect: OfFormula, columns: list[str], target: Target) -> Iterator[tuple[str, str]]:
    """Faults of the columns and the output of a formula, each with its key."""
    for symbol in effect.tree.names:
        if symbol not in columns and symbol not in effect.letters:
            known = f"{nearest(symbol, columns)}; parameters are single letters, perhaps with a number"
            yield FORMULA, f"{symbol} is no column of numbers{known}"
    outputs = [output.name for output in target.outputs]
    if effect.stated_keys.get("output", outputs[0] if len(outputs) == 1 else "") not in outputs:
        yield "output", f"must be one of {', '.join(outputs)}"


def _letter_faults(effect: OfFormula) -> Iterator[tuple[str, str]]:
    """Faults of the letters: each part needs one that it is proportional to, the others need bounds."""
    bounds = effect.stated_keys.get("bounds", {})
    for letter, pair in bounds.items() if isinstance(bounds, Mapping) else [("bounds", bounds)]:
        numbers = isinstance(pair, list) and len(pair) == 2 and all(isinstance(end, int | float) for end in pair)
        if letter not in effect.letters or not numbers or not pair[0] < pair[1]:
            yield "bounds", f"must give two increasing numbers for letters of the formula, got {letter} = {pair}"
    for letter in effect.letters:
        if letter not in effect.linear_letters and letter not in bounds:
            yield "bounds", f"is missing: {letter} is not linear; write bounds = {{ {letter} = [low, high] }}"
    at = dict.fromkeys(effect.tree.names, np.array([0.7, 1.3]))
    left = effect.tree.value(at | dict.fromkeys(effect.linear_letters, np.zeros(2)))
    if not effect.linear_letters or np.any(np.isfinite(left) & (left != 0.0)):
        yield FORMULA, "has a part that no letter multiplies: multiply each part by a parameter, such as a"


def _values(section: Section, effect: Effect, target: Target) -> dict[str, float] | None:
    """The parameters by their full names; None where one is faulty or missing."""
    declared = effect.parameters(target)
    values: dict[str, float] = {}
    faulty = False
    for key in section.all_keys():
        number = effect.parameter(key, target)
        value = None if number is None else _value(section, key, number)
        if number is None:
            section.take(key)
            close = nearest(key, (parameter.name for parameter in declared))
            section.fault(key, f"is not a parameter of {effect.name}{close}; {_list_parameters(declared)}")
        elif number.name in values:
            section.fault(key, f"is given twice: as {number.name} and as {number.stem}")
        elif value is not None:
            values[number.name] = value
            continue
        faulty = True
    missing = effect.missing(values, target)
    if faulty:
        return None
    for name in missing:
        section.fault(name, f"is missing: {effect.name} needs it")
    if not values and not missing:
        section.fault("", f"{effect.name} does nothing without parameters; {_list_parameters(declared)}")
    return values if values and not missing else None


def _value(section: Section, key: str, number: EffectParameter) -> float | None:
    value = section.take(key)
    if number.unit and key != number.name and not isinstance(value, str):
        section.fault(key, f'needs a unit: write {key} = "... {number.unit}", or {number.name}')
        return None
    converted = section.as_number(key, value, number.unit, Range(number.low, number.high), scale_only=True)
    if converted is not None and number.choices and converted not in number.choices:
        listed = ", ".join(f"{choice:g}" for choice in number.choices)
        section.fault(key, f"must be one of {listed}, got {shown(value)}")
        return None
    return converted


def _list_parameters(declared: Iterable[EffectParameter]) -> str:
    return f"it takes {', '.join(p.name for p in declared) or 'a parameter per lot: offset_<lot>_...'}"


def resolved_effects(effects: Iterable[Active]) -> dict[str, list[Mapping[str, Any]]]:
    """The `[[effect]]` and `[[unresolved]]` tables, none where there is neither."""
    active = tuple(effects)
    tables: list[Mapping[str, Any]] = [
        {"name": entry.effect.name, **entry.effect.stated(), "parameters": dict(entry.values)}
        for entry in active
        if not isinstance(entry.effect, Unresolved)
    ]
    return ({"effect": tables} if tables else {}) | resolved_unresolved(active)


# `[gear]`: the tooth numbers, or the orders, that effects over the angle follow.


GEAR = "gear"


def read_gear(top: Section) -> Gear | None:
    """The gear of a table, None where none is given or it is at fault."""
    if GEAR not in top:
        return None
    section = top.section(GEAR)
    kind = section.text("kind", TEETH)
    if "orders" in section:
        return _gear_by_orders(section, kind)
    if kind is None:
        if "kind" not in section:
            text = f"is missing: state one of {', '.join(TEETH)} with its tooth numbers"
            section.fault("kind", f'{text}, or orders = {{ "pin passing" = 45 }}')
        section.accept({name for names in TEETH.values() for name in names})
        section.finish()
        return None
    return _gear_by_teeth(section, kind)


ORDERS = Range(low=0.0, high=1e6, open_low=True)
"""Waves per turn of the output: a million of them are finer than an encoder resolves."""


def _gear_by_orders(section: Section, kind: str | None) -> Gear | None:
    """A gear by its orders, named after their causes."""
    inner = section.section("orders")
    numbers = {name: inner.number(name, "", ORDERS) for name in inner.all_keys()}
    teeth = [name for names in TEETH.values() for name in names if name in section]
    if kind is not None or teeth:
        section.accept((*teeth, "kind"))
        section.fault("orders", "cannot be combined with kind or tooth numbers: leave one of them out")
        return None
    if not numbers:
        section.fault("orders", 'must name at least one order, such as { "pin passing" = 45 }')
    section.finish()
    orders = {name: order for name, order in numbers.items() if order is not None}
    return Gear(DECLARED, orders) if orders and len(orders) == len(numbers) else None


def _gear_by_teeth(section: Section, kind: str) -> Gear | None:
    """A gear of a kind that has all its tooth numbers."""
    names = TEETH[kind]
    counts = {name: section.integer(name, Range(low=1, high=100_000), None) for name in names}
    section.finish()
    for name in names:
        if name not in section:
            section.fault(name, f'is missing: the effects of a gear of kind "{kind}" need {", ".join(names)}')
    teeth = {name: count for name, count in counts.items() if count is not None}
    if len(teeth) < len(names):
        return None
    wrong = contradictions(kind, teeth)
    for name, text in wrong.items():
        section.fault(name, text)
    return None if wrong else BUILD[kind](teeth)


def check_gear(top: Section, model: ModelClass | None, name: str) -> None:
    """Faults of a `[gear]` next to a model, whose parameters determine its gear."""
    gear = read_gear(top)
    if gear is None or model is None:
        return
    parameters = top.take("parameters")
    model_gear = model.gear_of(parameters if isinstance(parameters, Mapping) else {})
    if model_gear is None:
        top.fault(GEAR, f"has no effect: nothing that acts in {name} follows the orders of a gear; leave it out")
    elif not _have_equal_orders(model_gear, gear):
        orders = ", ".join(f"{what} {order:g}" for what, order in model_gear.orders.items())
        text = f"contradicts {name}, whose parameters give {orders}; leave it out"
        top.fault(GEAR, f"{text}, or set the model's own tooth numbers in [parameters]")


def _have_equal_orders(first: Gear, second: Gear) -> bool:
    """Whether the orders that both gears have are equal."""
    both = set(first.orders) & set(second.orders)
    return bool(both) and all(abs(first.orders[n] - second.orders[n]) < 1e-6 for n in both)


def resolved_gear(gear: Gear | None) -> dict[str, Mapping[str, Any]]:
    """The `[gear]` table with the orders of the gear, empty where there is none."""
    return {GEAR: {"orders": dict(gear.orders)}} if gear is not None else {}
