"""`[choice]` and `[rounding]`: how a point of the front is chosen, and what can be ordered."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..declarations import Kind, Output, Variable
from ..section import POSITIVE, Range, Section
from ..workflows.choice.settings import RULES, ChoiceSettings, Step
from .costs import unknown
from .goals import read_limits
from .resolved import resolved_limits


def read_choice(
    top: Section, objectives: Sequence[str], outputs: Sequence[Output], variables: Sequence[Variable]
) -> ChoiceSettings:
    """The settings of both tables; every fault is reported."""
    section = top.section("choice")
    weights = _weights(section.section("weights"), objectives)
    limits = read_limits(section.section("limits"), outputs, variables)
    budget = section.number("budget", within=POSITIVE)
    roughness = section.number("roughness_share", within=Range(low=0.0, high=1.0, open_low=True))
    section.finish()
    return ChoiceSettings(weights, limits, budget, _steps(top.section("rounding"), variables), roughness)


def _weights(section: Section, objectives: Sequence[str]) -> dict[str, float]:
    numbers = {name: section.number(name, within=Range(low=0.0)) for name in objectives}
    for name in section.all_keys():
        if name not in numbers:
            section.take(name)
            section.fault(name, unknown(name, list(objectives), "an objective of this run"))
    section.finish()
    weights = {name: value for name, value in numbers.items() if value is not None}
    if weights and not sum(weights.values()) > 0.0:
        section.fault("", "must not all be zero")
    return weights


def _steps(section: Section, variables: Sequence[Variable]) -> dict[str, Step]:
    steps = {v.name: _step(section, v) for v in variables if v.kind is not Kind.CHOICE and not v.integer}
    for v in variables:
        if v.name not in steps and v.name in section:
            section.take(v.name)
            section.fault(v.name, f"is a {v.kind}: it is not rounded")
    section.finish()
    return {name: step for name, step in steps.items() if step is not None}


def _step(section: Section, variable: Variable) -> Step | None:
    value = section.take(variable.name)
    if isinstance(value, str) and value in RULES:
        if variable.tolerance:
            return value
        section.fault(variable.name, "is not a tolerance: give a step or a list of values")
        return None
    if isinstance(value, list):
        numbers = section.numbers(variable.name)
        if numbers is not None and not numbers:
            section.fault(variable.name, "must hold at least one value")
        elif numbers and variable.tolerance and min(numbers) <= 0.0:
            section.fault(variable.name, f"must hold values above 0, got {min(numbers):g}")
        else:
            return numbers
        return None
    if isinstance(value, str) and not any(letter.isdigit() for letter in value):
        section.fault(variable.name, f'must be one of {", ".join(RULES)}, a step or a list of values, got "{value}"')
        return None
    return section.number(variable.name, variable.unit, POSITIVE)


def resolved_choice(settings: ChoiceSettings) -> dict[str, Any]:
    """The tables that state these settings; what was not given is left out."""
    numbers = {"budget": settings.budget, "roughness_share": settings.roughness_share}
    tables: Mapping[str, Any] = {"weights": dict(settings.weights), "limits": resolved_limits(settings.limits)}
    choice = {name: table for name, table in tables.items() if table}
    choice |= {name: number for name, number in numbers.items() if number is not None}
    steps = {name: list(step) if isinstance(step, tuple) else step for name, step in settings.steps.items()}
    return {name: table for name, table in (("choice", choice), ("rounding", steps)) if table}
