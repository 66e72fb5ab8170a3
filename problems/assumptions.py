"""Assumptions: values in use that no document prints."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..declarations import Assumption, Variable
from ..models.capability import PartSample
from ..models.machines.offers import PLUG_IN as ESTIMATED
from .promise import PLUG_IN, Promise

if TYPE_CHECKING:
    from .tolerance_problem import ToleranceProblem


PRINTED = "printed"
"""The interpretation in which a parameter has the value that a document prints."""
NOT_PRINTED = object()
SAMPLED = (
    "later parts are normal and come from the process that made the sample; the promise includes the "
    "uncertainty of its mean and scatter"
)


def process_assumption(promise: Promise | None) -> str:
    """The assumption about a measured process."""
    return ESTIMATED if promise is None or promise.statement == PLUG_IN else SAMPLED


def assumptions_of(problem: ToleranceProblem) -> tuple[Assumption, ...]:
    """Assumed parameters, ranges and cost curves, each with its value and who set it."""
    return (*_parameters(problem), *_variables(problem), *_costs(problem))


def _set_by(name: str, given: object) -> str:
    return "configuration" if name in given else "default"  # type: ignore[operator]


def _parameters(problem: ToleranceProblem) -> list[Assumption]:
    settings, given = problem.settings, problem.given
    return [
        Assumption(
            f"parameters.{p.name}", settings.parameters[p.name], p.unit, p.meaning, _set_by(p.name, given.parameters)
        )
        for p in problem.declaration.parameters
        if p.assumed and settings.parameters[p.name] != p.readings.get(PRINTED, NOT_PRINTED)
    ]


def _variables(problem: ToleranceProblem) -> list[Assumption]:
    assumptions = []
    for v in problem.variables:
        setting = problem.settings.variables[v.name]
        set_by = _set_by(v.name, problem.given.variables)
        if v.assumed and v.document is not None:
            place = f"references.{v.name}"
            assumptions.append(Assumption(place, v.document, v.unit, v.assumed))
        if setting.value is None:
            text = f"{setting.low:g} .. {setting.high:g}"
            reason = "search range; no document prints one"
            assumptions.append(Assumption(f"variables.{v.name}", text, v.unit, reason, set_by))
        if setting.sample is not None:
            assumptions += _measured(v, setting.sample, problem.settings.promise)
        elif v.random:
            kind = type(setting.distribution).__name__ if setting.distribution else "Uniform"
            reason = "distribution over units; the documents name none"
            place = f"variables.{v.name}.distribution"
            assumptions.append(Assumption(place, kind, "", reason, set_by))
    return assumptions


def _measured(variable: Variable, sample: PartSample, promise: Promise | None) -> list[Assumption]:
    """The statement of measured parts about a variable, and the assumptions that it needs."""
    place = f"variables.{variable.name}"
    known = sample.statement(variable.unit)
    return [
        Assumption(f"{place}.measured", known, "", process_assumption(promise), "configuration"),
        *(Assumption(f"{place}.{key}", "", "", why) for key, why in sample.assumed.items()),
    ]


def _costs(problem: ToleranceProblem) -> list[Assumption]:
    reason, money = "relative cost; the documents print no cost data", problem.settings.money
    if money.currency:
        price = f"; one assumed unit costs {money.scale:g} {money.currency}" if money.scale else ""
        return [
            Assumption(
                f"costs.{name}",
                repr(problem.settings.costs[name]),
                money.currency,
                f"assumed curve; the documents print no cost data{price}",
            )
            for name in money.assumed
        ]
    return [
        Assumption(f"costs.{name}", repr(curve), "", reason, _set_by(name, problem.given.costs))
        for name, curve in problem.settings.costs.items()
    ]
