"""`corrected.toml`: the model as recalibrated, with its effects, for `simulate` and `run`."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from typing import Any

import tomli_w

from ...errors import InputError
from ...gap_records import FoundEffect
from ...models.effects.unresolved import Unresolved
from ...models.inputs import Zone
from ...units import split_unit
from .close import Corrected
from .fit import Member
from .plan import GapPlan
from .population import Scatter
from .unresolved import is_term


def corrected_toml(plan: GapPlan, model: Corrected, scatter: tuple[Scatter, ...] = ()) -> str:
    """The run configuration (where there is one) with model, parameters, zeros and effects."""
    found: dict[str, Any] = deepcopy(dict(plan.run))
    if not found:
        found = {
            k: deepcopy(v) for k, v in plan.tables.items() if k not in ("effect", "unresolved")
        }
    found["model"] = plan.model_name
    found.setdefault("seed", plan.seed)
    parameters = dict(found.get("parameters", {})) | dict(plan.given)
    for name, value in model.free().items():
        table, dot, key = name.partition(".")
        if dot:
            parameters[table] = {**parameters.get(table, {}), key: value}
        else:
            parameters[name] = value
    if parameters:
        found["parameters"] = parameters
    if "variables" in found:
        found["variables"] = _at_mids(found["variables"], model.free())
    if turned := {name: one for name, one in plan.sense.items() if one < 0}:
        found["sense"] = turned
    if zero := _zero(plan, model):
        found["zero"] = zero
    terms = [_unresolved(one, model) for one in model.members if is_term(one)]
    more = [
        {"name": one.name, "parameters": model.effect(one.name)}
        for one in model.members
        if not is_term(one)
    ]
    # first: what moves units is not stretched with their scatter
    first = [{"name": one.candidate.name, "parameters": one.numbers} for one in scatter]
    effects = [*first, *found.get("effect", []), *plan.tables.get("effect", []), *more]
    if effects:
        found["effect"] = effects
    if terms := [*found.get("unresolved", []), *plan.tables.get("unresolved", []), *terms]:
        found["unresolved"] = terms
    if plan.model is None:
        found |= {"columns": {name: _column(one) for name, one in plan.columns.items()}}
    scalars = {k: v for k, v in found.items() if not isinstance(v, dict | list)}
    return tomli_w.dumps(_plain({**scalars, **found}))


def _at_mids(variables: Mapping[str, Any], free: Mapping[str, float]) -> dict[str, Any]:
    """The `[variables]` with the mid-limits that were recalibrated, where they state their own."""
    found = dict(variables)
    for name, one in variables.items():
        mid = free.get("{}_mid_{}".format(*split_unit(name)))
        if mid is not None and "limits" in one:
            half = Zone.of_text(one["limits"]).half_width
            kept = {key: value for key, value in one.items() if key != "limits"}
            found[name] = {"value": half, "mid": mid, **kept}
        elif mid is not None and "mid" in one:
            found[name] = {**one, "mid": mid}
    return found


def in_problem(
    plan: GapPlan, text: str, effects: tuple[FoundEffect, ...]
) -> tuple[FoundEffect, ...]:
    """The effects with what they do in the problem whose allocation is to be repeated."""
    if plan.counterparts is None:
        return effects
    name = plan.run["problem"]
    try:
        does = plan.counterparts(text)
    except InputError as error:
        why = "; ".join(f"{one.place}: {one.message}" for one in error.faults)
        return tuple(
            replace(one, in_problem=False, counterpart=f"{name} does not take it: {why}")
            for one in effects
        )
    none = f"no counterpart in {name}: the allocation does not change"
    return tuple(
        replace(one, in_problem=bool(does.get(one.name)), counterpart=does.get(one.name) or none)
        for one in effects
    )


def _unresolved(member: Member, model: Corrected) -> dict[str, Any]:
    effect = member.candidate.effect
    assert isinstance(effect, Unresolved)
    return effect.term.table(effect.coefficients(model.effect(member.name)))


def _zero(plan: GapPlan, model: Corrected) -> dict[str, float]:
    """What the instrument adds to each output: known before, and fitted."""
    fitted = {
        one.name: float(value)
        for one, value in zip(model.numbers, model.values, strict=True)
        if one.kind == "zero"
    }
    names = dict.fromkeys([*plan.zero, *fitted])
    return {name: plan.zero.get(name, 0.0) + fitted.get(name, 0.0) for name in names}


def _column(one: Any) -> dict[str, Any]:
    parts = {"role": one.role, "unit": one.unit, "of": one.of}
    turned = {"sense": one.sense} if one.sense < 0 else {}
    return {key: value for key, value in parts.items() if value} | turned


def _plain(value: Any) -> Any:
    """Values as TOML has them."""
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items() if one is not None}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return value.item() if hasattr(value, "item") else value
