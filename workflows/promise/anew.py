"""The same problem with another promise, at other levels, or with more known of its processes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ...declarations import Kind
from ...models.capability import Knowledge
from ...problems.settings import Bound, VariableSetting
from ...problems.stack import Stack
from ...problems.stack import anew as of_stacks
from ...problems.tolerance_problem import ToleranceProblem


def with_statement(problem: ToleranceProblem, statement: str) -> ToleranceProblem:
    """The problem with the same promise in the sense of another statement."""
    if isinstance(problem, Stack):
        return of_stacks.with_statement(problem, statement)
    promise = problem.given.promise
    assert promise is not None
    return type(problem)(replace(problem.given, promise=replace(promise, statement=statement)))


def cheapest_at(problem: ToleranceProblem, levels: Mapping[str, float]) -> ToleranceProblem:
    """Least cost alone, with upper limits on outputs in addition to the limits of the problem."""
    if isinstance(problem, Stack):
        return of_stacks.cheapest_at(problem, levels)
    limits = dict(problem.given.limits)
    for name, high in levels.items():
        limits[name] = replace(limits.get(name, Bound()), high=high)
    return type(problem)(replace(problem.given, objectives=("cost",), limits=limits))


def known_of(problem: ToleranceProblem) -> dict[str, Knowledge]:
    """What is known of parts or variables from their samples, by name."""
    if isinstance(problem, Stack):
        return {part.name: part.sample.knowledge for part in problem.definition.parts if part.sample is not None}
    return {
        name: setting.sample.knowledge
        for name, setting in problem.settings.variables.items()
        if setting.sample is not None
    }


def with_knowledge(problem: ToleranceProblem, known: Mapping[str, Knowledge]) -> ToleranceProblem:
    """The problem with other knowledge of the processes of some measured parts or variables."""
    if isinstance(problem, Stack):
        return of_stacks.with_knowledge(problem, known)
    kinds = {v.name: v.kind for v in problem.variables}
    settings = {
        name: _variable(problem.given.variables[name], kinds[name], knowledge) for name, knowledge in known.items()
    }
    variables = dict(problem.given.variables) | settings
    return type(problem)(replace(problem.given, variables=variables))


def _variable(setting: VariableSetting, kind: Kind, known: Knowledge) -> VariableSetting:
    assert setting.sample is not None
    offset = known.mean if setting.sample.offset else 0.0
    sample = replace(setting.sample, knowledge=known, offset=offset)
    if kind is Kind.STANDARD_DEVIATION:
        return replace(setting, sample=sample, value=known.std)
    return replace(setting, sample=sample, distribution=sample.distribution)
