"""Numbers of a configuration that look as if they were stated in another unit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from ..errors import Fault
from ..likely_units import unit_hint

if TYPE_CHECKING:
    from .tolerance_problem import ToleranceProblem

FAR = 20.0
"""Ratio of a number to the usual one, or its inverse, above which it is suspicious."""
NEAR = 3.0
"""Largest ratio to the usual number in the unit that was probably meant."""


def unit_slips(problem: ToleranceProblem) -> list[Fault]:
    """Parameters and tolerances far from the usual ones that another unit would explain.

    What is usual is the default of a parameter and the default range of a variable.
    """
    return [Fault(place, text) for place, text in (*_parameters(problem), *_variables(problem))]


def slip(value: float, unit: str, low: float, high: float) -> str:
    """Why a number is suspicious where `low` to `high` is usual, empty where it is not."""
    if low / FAR <= value <= high * FAR or low <= 0.0 or value <= 0.0:
        return ""
    hint = unit_hint(value, unit, low / NEAR, high * NEAR)
    usual = f"{low:g} {unit}" if low == high else f"{low:g} to {high:g} {unit}"
    return f"{value:g} {unit} is far from what is usual ({usual}){hint}" if hint else ""


def _parameters(problem: ToleranceProblem) -> Iterator[tuple[str, str]]:
    for parameter in problem.declaration.parameters:
        value, default = problem.settings.parameters.get(parameter.name), parameter.default
        if not (isinstance(value, int | float) and isinstance(default, int | float) and parameter.unit):
            continue
        if text := slip(abs(value), parameter.unit, abs(default), abs(default)):
            yield f"parameters.{parameter.name}", text


def _variables(problem: ToleranceProblem) -> Iterator[tuple[str, str]]:
    usual = {variable.name: variable for variable in type(problem).declaration.variables}
    for name, setting in problem.settings.variables.items():
        variable = usual.get(name)
        if variable is None or not variable.tolerance:
            continue
        for key in ("value", "low", "high"):
            value = getattr(setting, key)
            if value is not None and (text := slip(value, variable.unit, variable.low, variable.high)):
                yield f"variables.{name}.{key}", text
