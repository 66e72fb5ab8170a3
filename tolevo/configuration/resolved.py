"""Every value of a configuration as tables, ready to be written and read again."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

from ..models.cost_reading import curve_table
from ..models.input_reading import written as distribution_table
from ..models.inputs import Uniform
from ..problems.cost_columns import column_tables, robust_table
from ..problems.promise import means_promise
from ..problems.settings import Bound, Settings, VariableSetting
from ..problems.tolerance_problem import ToleranceProblem
from ..section import Variable, nested
from .columns import resolved_columns
from .costs import resolved_money
from .parameters import resolved_effects
from .plugins import RECORD, resolved_sense, resolved_zero


def complete_tables(problem: ToleranceProblem, name: str, model: str) -> dict[str, Any]:
    """The tables of a problem that configurations know as `name`, and of its model (may be "").

    Reading them again gives the same problem.
    """
    settings = problem.settings
    return {
        "problem": name,
        **({"model": model} if model else {}),
        **settings.labels.stated(),
        "seed": settings.seed,
        **resolved_money(settings.money, resolved_problem(problem)),
        **column_tables(problem),
        **robust_table(problem),
        **resolved_measurement(settings),
    }


def resolved_measurement(settings: Settings) -> dict[str, Any]:
    """The tables of what is measured: columns, zeros and senses of outputs, effects."""
    return {
        **resolved_columns(settings.columns),
        **resolved_zero(settings.zero),
        **resolved_sense(settings.sense),
        **resolved_effects((*settings.effects, *settings.terms)),
        **({RECORD: {name: list(ends) for name, ends in settings.record.items()}} if settings.record else {}),
    }


def resolved_problem(problem: ToleranceProblem) -> dict[str, Any]:
    """The tables of a problem from its completed settings, or those it is written in."""
    settings, written = problem.settings, problem
    return {
        **(written.tables() or _tables(problem)),
        **written.more_tables(),
        "objectives": {"minimise": list(settings.objectives)},
        "limits": resolved_limits(
            {
                name: bound
                for name, bound in settings.limits.items()
                if problem.promise is None or not means_promise(name, problem.promise)
            }
        ),
    }


def _tables(problem: ToleranceProblem) -> dict[str, Any]:
    settings = problem.settings
    return {
        "parameters": dict(settings.parameters),
        "variables": _variable_tables(problem),
        "costs": {name: curve_table(curve) for name, curve in settings.costs.items()},
        "propagation": asdict(settings.propagation),
    }


def _variable_tables(problem: ToleranceProblem) -> dict[str, Any]:
    """The `[variables]` tables, machines included; keys that machines determine are left out."""
    settings = problem.settings
    resolved = resolved_variables(settings.variables, problem.variables)
    for name, offers in settings.machines.items():
        mid = {"mid": resolved[name]["mid"]} if "mid" in resolved[name] else {}
        resolved[name] = mid | {"machine": [offer.table() for offer in offers]}
    return resolved


def resolved_variables(settings: Mapping[str, VariableSetting], variables: Iterable[Variable]) -> dict[str, Any]:
    """The `[variables]` tables."""
    return {v.name: _variable(settings[v.name], v) for v in variables}


def _variable(setting: VariableSetting, variable: Variable) -> dict[str, Any]:
    ends = {"value": setting.value, "low": setting.low, "high": setting.high, "mid": setting.mid}
    if setting.sample is not None and not variable.random:
        return {"measured": dict(setting.sample.stated)}  # the value is the sample's
    table: dict[str, Any] = {key: end for key, end in ends.items() if end is not None}
    if variable.integer:
        table = {key: int(end) if key != "mid" else end for key, end in table.items()}
    if setting.sample is not None:
        return table | {"measured": dict(setting.sample.stated)}
    return table | (distribution_table(setting.distribution or Uniform()) if variable.random else {})


def resolved_limits(limits: Mapping[str, Bound]) -> dict[str, Any]:
    """The `[limits]` table."""
    ends = {name: {"min": bound.low, "max": bound.high} for name, bound in limits.items()}
    return nested({name: {key: end for key, end in pair.items() if math.isfinite(end)} for name, pair in ends.items()})
