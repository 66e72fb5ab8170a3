"""What `tolevo check` prints: the resolved configuration, and the rest as its comments."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from .. import registry
from ..commands.run.proofs import searchable
from ..commands.run.tolerances import roughness_assumptions
from ..models.effects.effect import Target
from ..models.effects.measurements import target_of
from ..problems.settings import VariableSetting, unit_of_cost
from ..section import Assumption, Variable
from .configuration import TABLE, Configuration, table_model
from .reader import build_model, read
from .source import Source, is_gap, is_study

if TYPE_CHECKING:
    from ..commands.study.plan import StudyPlan


def describe(configuration: Configuration) -> str:
    """TOML that can be run as it stands, with variables, assumptions and warnings as comments."""
    problem = configuration.problem
    if problem is None:
        return _append_comments(configuration.toml(), _effects(configuration))
    settings = configuration.settings.variables
    statement = problem.declaration.model_statement
    lines = ["Model", f"  {statement}", ""] if statement else []
    lines += _effects(configuration)
    lines += [f"Costs in {unit}", ""] if (unit := unit_of_cost(problem.settings.money)) else []
    lines += ["Variables", *(_variable(v, settings[v.name]) for v in problem.variables)]
    lines += [
        "",
        "Assumptions (with who set each)",
        *_assumptions(problem.assumptions()),
        *_assumptions(roughness_assumptions(problem, configuration.choice)),
    ]
    if warnings := problem.cautions():
        lines += ["", "Warnings", *(f"  {warning}" for warning in warnings)]
    return _append_comments(configuration.toml(), lines)


def _append_comments(toml: str, lines: list[str]) -> str:
    comments = "\n".join(f"# {line}".rstrip() for line in lines)
    return f"{toml}\n{comments}" if lines else toml


def _effects(configuration: Configuration) -> list[str]:
    """The active effects, their causes and parameters, and what they do in the problem."""
    effects, problem = configuration.settings.effects, configuration.problem
    if not effects:
        return []
    target, lines = _target(configuration), []
    for active in effects:
        parameters = [f"{name} = {value:g}" for name, value in active.values.items()]
        more = active.effect.described(active.values, target)
        parameters += [f"{name} = {value:.6g} {unit}" for name, (value, unit) in more.items()]
        lines.append(f"  {active.effect.name} ({active.effect.family}): {active.effect.cause}")
        lines.append(f"    {', '.join(parameters)}")
    notes = problem.effect_notes() if problem is not None else ()
    return ["Effects", *lines, *(f"  {note}" for note in notes), ""]


def _target(configuration: Configuration) -> Target:
    """What the effects act in."""
    name = configuration.model_name
    if name == TABLE:
        return target_of(table_model(configuration.settings.definition, configuration.settings.gear), name)
    kind = registry.load("models", name)
    return replace(target_of(kind, name), gear=kind.gear_of(configuration.settings.parameters))


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
    return [f"  {a.name} = {a.value} {a.unit} ({a.set_by}): {a.reason}".replace("  (", " (") for a in assumptions]


def describe_plan(plan: StudyPlan) -> str:
    """TOML of a study that can be run as it stands, with its size and warnings as comments."""
    settings = plan.settings
    count = len(plan.design)
    lines = [
        f"{count * settings.seeds} runs: {count} settings, {settings.seeds} replicates each",
        f"Responses: {', '.join(settings.responses)}",
    ]
    if len(plan.points) < count:
        text = f"{len(plan.points)} of the settings were read as run configurations"
        lines.append(f"{text}; `tolevo study` reads all of them before it begins")
    if plan.warnings:
        lines += ["", "Warnings", *(f"  {warning}" for warning in plan.warnings)]
    return _append_comments(settings.configuration, lines)


# `tolevo check`: a configuration of any kind, validated, and the text that states all of it.


CHECKED = 300
"""Settings of a study that are read as runs: reading all of them would take too long."""


def checked(source: Source, overrides: Sequence[str] = ()) -> str:
    """The resolved configuration as TOML with comments. Raises InputError with every fault."""
    if is_study(source):
        from ..commands.study.configuration import read_study

        return describe_plan(read_study(source, overrides, CHECKED))
    if is_gap(source):
        from ..commands.gap.configuration import read_gap

        return read_gap(source, overrides).configuration
    configuration = read(source, overrides)
    if configuration.problem is None:
        build_model(configuration)  # raises faults that only the physics of the model can detect
    else:
        coarser = configuration.problem.coarser()  # whatever its size, in seconds
        searchable(coarser, configuration.algorithm)
    return describe(configuration)
