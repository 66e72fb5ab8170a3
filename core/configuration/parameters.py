"""`[parameters]`: the named inputs of the physical model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ..counts import PLAIN
from ..declarations import Parameter, Value
from ..section import Range, Section, shown
from ..units import split_unit


def read_parameters(section: Section, declared: Iterable[Parameter]) -> dict[str, Value]:
    """The parameters that the configuration sets."""
    values = {parameter.name: _read(section, parameter) for parameter in declared}
    section.finish()
    return {name: value for name, value in values.items() if value is not None}


def _read(section: Section, parameter: Parameter) -> Value | None:
    within = Range(parameter.low, parameter.high, open_low=parameter.open_low)
    match parameter.default:
        case bool():
            return section.flag(parameter.name)
        case str():
            return section.text(parameter.name, parameter.choices)
        case int() if not parameter.unit:
            return section.integer(parameter.name, within, parameter.need or PLAIN)
        case tuple():
            return _list(section, parameter, len(parameter.default), within)
        case Mapping():
            return _table(section, parameter, within)
        case _:
            return section.quantity(parameter.name, parameter.unit, within)


def _list(section: Section, parameter: Parameter, count: int, within: Range) -> tuple[float, ...] | None:
    """Exactly `count` numbers in the unit of the parameter, or strings with a unit."""
    value = section.take(parameter.name)
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != count:
        stated = f"{len(value)} of them" if isinstance(value, list) else shown(value)
        section.fault(parameter.name, f"must be a list of {count} numbers, got {stated}")
        return None
    name, unit = parameter.name, parameter.unit
    checked = [section.as_number(f"{name}[{i}]", entry, unit, within) for i, entry in enumerate(value)]
    numbers = tuple(number for number in checked if number is not None)
    return numbers if len(numbers) == count else None


def _table(section: Section, parameter: Parameter, within: Range) -> dict[str, float] | None:
    """Numbers by name, each name one of the parameter's choices."""
    if parameter.name not in section:
        return None
    table = section.section(parameter.name)
    numbers = {name: table.quantity(name, split_unit(name)[1], within) for name in parameter.choices}
    table.finish()
    return {name: value for name, value in numbers.items() if value is not None}
