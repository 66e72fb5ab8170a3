"""`[[effect]]`: the effects that are active in the model, with their parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from ..errors import nearest
from ..models.effects.compose import Active
from ..models.effects.effect import Effect, EffectParameter, Target
from ..models.effects.measurements import target_of
from ..models.effects.unresolved import Unresolved
from ..models.measurable import MeasurableModel
from ..registry import PLUGIN_FAULTS
from ..section import Range, Section, shown
from .plugins import ModelClass, load_named
from .unresolved import resolved_unresolved


def read_effects(top: Section, model: ModelClass | MeasurableModel | None, name: str) -> tuple[Active, ...]:
    """The effects in the model `name`, of the class `model` (None where it is not known)."""
    sections = top.items("effect")
    if sections and model is None and not name:
        top.fault("effect", "needs a model: this problem has none that effects could act in")
    target = target_of(model, name) if sections and model is not None else None
    if target is not None and isinstance(model, type):  # it is not built yet: its parameters give its gear
        parameters = top.take("parameters")
        target = replace(target, gear=model.gear_of(parameters if isinstance(parameters, Mapping) else {}))
    effects = [_effect(section, target) for section in sections]
    return tuple(effect for effect in effects if effect is not None)


def _effect(section: Section, target: Target | None) -> Active | None:
    if "name" not in section:
        section.fault("name", "is missing: name an effect (see `tolevo list`)")
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
            section.fault(key, f"is not a parameter of {effect.name}{close}; {_listed(declared)}")
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
        section.fault("", f"{effect.name} does nothing without parameters; {_listed(declared)}")
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


def _listed(declared: Iterable[EffectParameter]) -> str:
    return f"it takes {', '.join(p.name for p in declared) or 'a parameter per lot: offset_<lot>_...'}"


def resolved_effects(effects: Iterable[Active]) -> dict[str, list[Mapping[str, Any]]]:
    """The `[[effect]]` and `[[unresolved]]` tables, none where there is neither."""
    active = tuple(effects)
    tables: list[Mapping[str, Any]] = [
        {"name": entry.effect.name, "parameters": dict(entry.values)}
        for entry in active
        if not isinstance(entry.effect, Unresolved)
    ]
    return ({"effect": tables} if tables else {}) | resolved_unresolved(active)
