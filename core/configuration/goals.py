"""`[objectives]`, `[limits]` and `[propagation]`."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

from ..counts import SAMPLES
from ..declarations import Output, Variable
from ..problems.settings import METHODS, Bound, PropagationSetting
from ..section import Range, Section
from .costs import unknown
from .nested import Nested

INSIDE = Range(0.0, 1.0, open_low=True, open_high=True)


def read_objectives(section: Section, outputs: Sequence[Output]) -> tuple[str, ...]:
    """The outputs to minimise, empty where the problem's own are meant."""
    names = section.names("minimise") or []
    section.finish()
    by_name = {output.name: output for output in outputs}
    valid = [o.name for o in outputs if not o.larger_is_better and not o.error_of]
    for at, name in enumerate(names):
        if name in names[:at]:
            section.fault("minimise", f'"{name}" is named twice')
        elif name not in by_name:
            section.fault("minimise", unknown(name, valid, "an output"))
        elif by_name[name].larger_is_better:
            section.fault("minimise", f'"{name}" is better when larger: limit it instead')
        elif by_name[name].error_of:
            text = f'"{name}" is the error of {by_name[name].error_of}, not a property of the design'
            section.fault("minimise", text)
    return tuple(names)


def read_limits(section: Section, outputs: Sequence[Output], variables: Sequence[Variable]) -> dict[str, Bound]:
    """Limits by output (or variable); they take the place of the problem's own."""
    numeric = [v for v in variables if not v.labels]
    places = Nested(section, [*(o.name for o in outputs), *(v.name for v in numeric)])
    for output in outputs:
        table, key = places.find(output.name)
        if output.error_of and key in table:
            table.take(key)
            table.fault(key, f"is the error of {output.error_of} and cannot be limited")
    limitable = [output for output in outputs if not output.error_of]
    limits = {o.name: _limit(*places.find(o.name), o.unit, Range(o.low, o.high), o.larger_is_better) for o in limitable}
    limits |= {v.name: _limit(section, v.name, v.unit, Range(), False) for v in numeric}
    places.finish()
    return {name: bound for name, bound in limits.items() if bound is not None}


def _limit(section: Section, name: str, unit: str, within: Range, lower: bool) -> Bound | None:
    value = section.take(name)
    if value is None:
        return None
    if not isinstance(value, dict):
        number = section.as_number(name, value, unit, within)
        if number is None:
            return None
        return Bound(low=number) if lower else Bound(high=number)
    table = section.section(name)
    low, high = (table.number(key, unit, within) for key in ("min", "max"))
    table.finish()
    if not value.keys() & {"min", "max"}:
        section.fault(name, "needs min, max or both")
        return None
    if low is not None and high is not None and low > high:
        table.fault("min", f"must not be above max ({high:g}), got {low:g}")
        return None
    return Bound(-inf if low is None else low, inf if high is None else high)


def read_propagation(section: Section) -> PropagationSetting:
    """How spread is propagated."""
    default = PropagationSetting()
    method = section.text("method", METHODS)
    coverage = section.number("coverage", within=INSIDE)
    samples = section.integer("samples", Range(2, 2**26), SAMPLES)
    section.finish()
    return PropagationSetting(
        default.method if method is None else method,
        default.coverage if coverage is None else coverage,
        default.samples if samples is None else samples,
    )
