"""What `tolevo check` prints: the resolved configuration, and the rest as its comments."""

from __future__ import annotations

from collections.abc import Iterable

from ..declarations import Assumption, Variable
from ..problems.settings import VariableSetting
from .configuration import Configuration


def describe(configuration: Configuration) -> str:
    """TOML that can be run as it stands, with variables, assumptions and warnings as comments."""
    problem = configuration.problem
    if problem is None:
        return _commented(configuration.toml(), _effects(configuration))
    settings = configuration.settings.variables
    lines = _effects(configuration)
    lines += ["Variables", *(_variable(v, settings[v.name]) for v in problem.variables)]
    lines += ["", "Assumptions (no document prints them)", *_assumptions(problem.assumptions())]
    if warnings := problem.warnings():
        lines += ["", "Warnings", *(f"  {warning}" for warning in warnings)]
    return _commented(configuration.toml(), lines)


def _commented(toml: str, lines: list[str]) -> str:
    comments = "\n".join(f"# {line}".rstrip() for line in lines)
    return f"{toml}\n{comments}" if lines else toml


def _effects(configuration: Configuration) -> list[str]:
    """The active effects, their causes and parameters, and what they do in the problem."""
    active, problem = configuration.settings.effects, configuration.problem
    lines = []
    for one in active:
        values = ", ".join(f"{name} = {value:g}" for name, value in one.values.items())
        lines.append(f"  {one.effect.name} ({one.effect.family}): {one.effect.cause}")
        lines.append(f"    {values}")
    notes = problem.effect_notes() if problem is not None else ()
    return ["Effects", *lines, *(f"  {note}" for note in notes), ""] if active else []


def _variable(variable: Variable, setting: VariableSetting) -> str:
    if variable.labels:
        names = [variable.labels[0]] if setting.value is not None else variable.labels
        return f"  {variable.name}: {' or '.join(names)}; {variable.kind}"
    if setting.value is not None:
        where = f"fixed at {setting.value:g} {variable.unit}"
    else:
        where = f"{setting.low:g} to {setting.high:g} {variable.unit}"
    if setting.mid is not None:
        where += f", mid {setting.mid:g} {variable.unit}"
    return f"  {variable.name}: {where.rstrip()}; {variable.kind}"


def _assumptions(assumptions: Iterable[Assumption]) -> list[str]:
    return [
        f"  {one.name} = {one.value} {one.unit} ({one.set_by}): {one.reason}".replace("  (", " (")
        for one in assumptions
    ]
