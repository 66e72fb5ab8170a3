"""`corrected.toml`: the model as recalibrated, with its effects, for `simulate` and `run`."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from typing import Any

import tomli_w

from ...errors import InputError
from ...gap_records import FoundEffect
from ...models.inputs import Zone
from ...units import split_unit
from .close import Corrected
from .fit import is_term
from .plan import GapPlan
from .population import Scatter
from .unresolved import table_of


def corrected_toml(plan: GapPlan, model: Corrected, scatter: tuple[Scatter, ...] = ()) -> str:
    """The run configuration (where there is one) with model, parameters, zeros and effects."""
    configuration: dict[str, Any] = deepcopy(dict(plan.run))
    if not configuration:
        configuration = {k: deepcopy(v) for k, v in plan.tables.items() if k not in ("effect", "unresolved")}
    configuration["model"] = plan.model_name
    configuration.setdefault("seed", plan.seed)
    parameters = dict(configuration.get("parameters", {})) | dict(plan.stated_parameters)
    for name, value in model.free().items():
        table, dot, key = name.partition(".")
        if dot:
            parameters[table] = {**parameters.get(table, {}), key: value}
        else:
            parameters[name] = value
    if parameters:
        configuration["parameters"] = parameters
    if "variables" in configuration:
        configuration["variables"] = _at_mids(configuration["variables"], model.free())
    if turned := {name: sense for name, sense in plan.sense.items() if sense < 0}:
        configuration["sense"] = turned
    if zero := zeros_with(plan, model):
        configuration["zero"] = zero
    terms = [table_of(member, model) for member in model.members if is_term(member)]
    more = [
        {"name": member.name, "parameters": model.effect(member.name)}
        for member in model.members
        if not is_term(member)
    ]
    # first: what moves units is not stretched with their scatter
    first = [
        {"name": scatter_effect.candidate.name, "parameters": scatter_effect.numbers} for scatter_effect in scatter
    ]
    effects = [*first, *configuration.get("effect", []), *plan.tables.get("effect", []), *more]
    if effects:
        configuration["effect"] = effects
    if terms := [*configuration.get("unresolved", []), *plan.tables.get("unresolved", []), *terms]:
        configuration["unresolved"] = terms
    if plan.model is None:
        configuration |= {"columns": {name: _column(column) for name, column in plan.columns.items()}}
    scalars = {k: v for k, v in configuration.items() if not isinstance(v, dict | list)}
    return tomli_w.dumps(_toml_value({**scalars, **configuration}))


def _at_mids(variables: Mapping[str, Any], free: Mapping[str, float]) -> dict[str, Any]:
    """The `[variables]` with the mid-limits that were recalibrated, where they state any."""
    updated = dict(variables)
    for name, variable in variables.items():
        mid = free.get("{}_mid_{}".format(*split_unit(name)))
        if mid is not None and "limits" in variable:
            half = Zone.of_text(variable["limits"]).half_width
            kept = {key: value for key, value in variable.items() if key != "limits"}
            updated[name] = {"value": half, "mid": mid, **kept}
        elif mid is not None and "mid" in variable:
            updated[name] = {**variable, "mid": mid}
    return updated


def in_problem(plan: GapPlan, text: str, effects: tuple[FoundEffect, ...]) -> tuple[FoundEffect, ...]:
    """The effects with their counterparts in the problem whose allocation is to be repeated."""
    if plan.counterparts is None:
        return effects
    name = plan.run["problem"]
    none = f"no counterpart in {name}: the allocation does not change"
    counterparts: Mapping[str, str] = {}
    try:
        counterparts = plan.counterparts(text)
    except InputError as error:
        why = "; ".join(f"{fault.place}: {fault.message}" for fault in error.faults)
        none = f"{name} does not accept it: {why}"
    pairs = [(effect, counterparts.get(effect.name, "")) for effect in effects]
    return tuple(replace(effect, in_problem=bool(what), counterpart=what or none) for effect, what in pairs)


def zeros_with(plan: GapPlan, model: Corrected) -> dict[str, float]:
    """What the instrument adds to each output: the known part plus the fitted one."""
    fitted = {number.name: value for number, value in model.numbers_of("zero")}
    return {name: plan.zero.get(name, 0.0) + fitted.get(name, 0.0) for name in {**plan.zero, **fitted}}


def _column(column: Any) -> dict[str, Any]:
    parts = {"role": column.role, "unit": column.unit, "of": column.of}
    turned = {"sense": column.sense} if column.sense < 0 else {}
    return {key: value for key, value in parts.items() if value} | turned


def _toml_value(value: Any) -> Any:
    """Values in the types of TOML."""
    if isinstance(value, Mapping):
        return {str(key): _toml_value(entry) for key, entry in value.items() if entry is not None}
    if isinstance(value, list | tuple):
        return [_toml_value(entry) for entry in value]
    return value.item() if hasattr(value, "item") else value
