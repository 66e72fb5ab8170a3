"""`[parameters]`: the named inputs of the physical model."""

from __future__ import annotations

from collections.abc import Iterable

from ..declarations import Parameter, Value
from ..section import Range, Section


def read_parameters(section: Section, declared: Iterable[Parameter]) -> dict[str, Value]:
    """The parameters that the configuration sets."""
    found = {parameter.name: _read(section, parameter) for parameter in declared}
    section.finish()
    return {name: value for name, value in found.items() if value is not None}


def _read(section: Section, parameter: Parameter) -> Value | None:
    within = Range(parameter.low, parameter.high, open_low=parameter.open_low)
    match parameter.default:
        case bool():
            return section.flag(parameter.name)
        case str():
            return section.text(parameter.name, parameter.choices)
        case int() if not parameter.unit:
            return section.integer(parameter.name, within)
        case _:
            return section.quantity(parameter.name, parameter.unit, within)
