"""Every value of a configuration as tables, ready to be written and read again."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

from ..declarations import Variable
from ..models.costs import CostCurve
from ..models.inputs import Uniform
from ..models.inputs.reading import written
from ..problems.settings import Bound, Settings, VariableSetting
from .costs import name_of


def resolved_problem(settings: Settings, variables: Iterable[Variable]) -> dict[str, Any]:
    """The tables of a problem from its completed settings."""
    return {
        "parameters": dict(settings.parameters),
        "variables": resolved_variables(settings.variables, variables),
        "costs": {name: _curve(curve) for name, curve in settings.costs.items()},
        "propagation": asdict(settings.propagation),
        "objectives": {"minimise": list(settings.objectives)},
        "limits": {name: _limit(bound) for name, bound in settings.limits.items()},
    }


def resolved_variables(
    settings: Mapping[str, VariableSetting], variables: Iterable[Variable]
) -> dict[str, Any]:
    """The `[variables]` tables."""
    return {v.name: _variable(settings[v.name], v) for v in variables}


def _variable(setting: VariableSetting, variable: Variable) -> dict[str, Any]:
    ends = {"value": setting.value, "low": setting.low, "high": setting.high, "mid": setting.mid}
    found: dict[str, Any] = {key: end for key, end in ends.items() if end is not None}
    if variable.integer:
        found = {key: int(end) if key != "mid" else end for key, end in found.items()}
    return found | (written(setting.distribution or Uniform()) if variable.random else {})


def _curve(curve: CostCurve) -> dict[str, Any]:
    coefficients: dict[str, Any] = asdict(curve)  # type: ignore[call-overload]
    return {"model": name_of(curve)} | {
        key: list(value) if isinstance(value, tuple) else value
        for key, value in coefficients.items()
    }


def _limit(bound: Bound) -> dict[str, float]:
    ends = {"min": bound.low, "max": bound.high}
    return {key: end for key, end in ends.items() if math.isfinite(end)}
