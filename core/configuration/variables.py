"""`[variables.<name>]`: what is fixed, what is searched, and how it is distributed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ..declarations import TOLERANCES, Kind, Value, Variable
from ..likely_units import unit_hint
from ..models.inputs import Distribution, Zone
from ..models.inputs.reading import keys, read_distribution
from ..problems.settings import VariableSetting
from ..section import Range, Section
from ..units import split_unit
from .measured_variables import read_measured


def read_variable(section: Section, variable: Variable, parameters: Mapping[str, Value]) -> Any:
    """The `VariableSetting` that a table states, None where it states nothing."""
    value, low, high = (_bound(section, variable, key) for key in ("value", "low", "high"))
    mid = _mid(section, variable)
    zone = _zone(section, variable)
    if zone is not None:
        value, mid = zone.half_width, zone.mid
        _outside(section, variable, "limits", value)
    elif "value" in section and ("low" in section or "high" in section):
        section.fault("", "give either value or low and high, not both")
    elif "value" not in section:
        _order(section, variable, low, high)
    mid = _agreed(section, variable, mid, parameters)
    law = _distribution(section, variable)
    middle = variable.mid if mid is None else mid
    sample = read_measured(section, variable, middle, value)
    if sample is not None and variable.random:
        law, mid = sample.distribution, middle
    elif sample is not None:
        value = sample.knowledge.std
        _outside(section, variable, "measured", value)
    setting = VariableSetting(value, low, high, law, mid, sample)
    section.finish()
    return None if setting == VariableSetting() else setting


def mid_parameter(variable: str) -> str:
    """Name of the parameter that holds the mid-limit of a variable."""
    return "{}_mid_{}".format(*split_unit(variable))


def _bound(section: Section, variable: Variable, key: str) -> float | None:
    number = section.number(key, variable.unit)
    return None if number is None or _outside(section, variable, key, number) else number


def _outside(section: Section, variable: Variable, key: str, number: float) -> bool:
    least = max(variable.valid_low, 0.0) if variable.kind in TOLERANCES else variable.valid_low
    complaint = Range(least, variable.valid_high).complaint(number)
    if variable.integer and not number.is_integer():
        complaint = f"must be a whole number, got {number}"
    if complaint:
        section.fault(key, complaint + unit_hint(number, variable.unit, variable.low, variable.high))
    return bool(complaint)


def _order(section: Section, variable: Variable, low: float | None, high: float | None) -> None:
    """A range that is reversed or empty; an end that is not given is the problem's own."""
    least = variable.low if low is None else low
    most = variable.high if high is None else high
    if least >= most and not (low is None and high is None):
        section.fault("low", f"must be below high ({most:g}), got {least:g}")


def _mid(section: Section, variable: Variable) -> float | None:
    mid = section.number("mid", variable.unit)
    if "mid" in section and variable.mid is None:
        section.fault("mid", f"{variable.name} ({variable.kind}) has no mid-limit")
        return None
    return mid


def _zone(section: Section, variable: Variable) -> Zone | None:
    text = section.text("limits")
    if text is None:
        return None
    if variable.kind is not Kind.HALF_WIDTH:
        section.fault("limits", f"do not apply to a {variable.kind}: give value")
        return None
    if conflicting := [key for key in ("value", "low", "high", "mid") if key in section]:
        section.fault("limits", f"set value and mid: leave out {', '.join(conflicting)}")
        return None
    try:
        zone = Zone.of_text(text)
    except ValueError as error:
        section.fault("limits", str(error))
        return None
    if not (math.isfinite(zone.mid) and math.isfinite(zone.half_width)):
        section.fault("limits", f'must be finite, got "{text}"')
        return None
    return zone


def _agreed(section: Section, variable: Variable, mid: float | None, parameters: Mapping[str, Value]) -> float | None:
    """The mid-limit; `[parameters]` may state it as well, or instead."""
    name = mid_parameter(variable.name)
    parameter = parameters.get(name)
    if not isinstance(parameter, int | float) or isinstance(parameter, bool) or variable.mid is None:
        return mid
    if mid is not None and not math.isclose(mid, parameter, rel_tol=1e-9, abs_tol=1e-12):
        key = "mid" if "mid" in section else "limits"
        section.fault(key, f"differs from parameters.{name}: {mid:g} here, {parameter:g} there")
    return float(parameter) if mid is None else mid


def _distribution(section: Section, variable: Variable) -> Distribution | None:
    if not variable.random:
        for key in keys():
            if section.take(key) is not None:
                section.fault(key, f"{variable.name} ({variable.kind}) has no distribution to set")
        return None
    law = read_distribution(section)
    if law is None or not law.one_sided:
        return law
    radius = "is a radius, from mid to mid + t"
    if variable.kind is not Kind.HALF_WIDTH:
        section.fault("distribution", f"{radius}: it does not apply to a {variable.kind}")
    elif "limits" in section:
        section.fault("limits", f"do not apply: the input {radius}. Give value and mid")
    return law
