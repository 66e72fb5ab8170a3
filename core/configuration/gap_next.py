"""`[next_measurement]` of a gap analysis: how many measurements, and where they may be taken."""

from __future__ import annotations

from collections.abc import Iterable
from math import prod
from typing import Any

import numpy as np

from .. import registry
from ..errors import nearest
from ..models.effects.measurements import EXTRAS
from ..models.measurable import Column, MeasurableModel, Role
from ..models.table import MeasuredTable
from ..section import POSITIVE, Range, Section, shown
from ..units import converted
from ..workflows.gap.next.points import inside
from ..workflows.gap.plan import NextPlan, Span

KEY = "next_measurement"
MEASUREMENTS = Range(1, 100_000)
ABSOLUTE_ZERO = -273.15
"""[degC]"""
MESH = 100_000
"""Largest number of points that are tried."""
STEPS = 33
"""Values of each range that are tried to test whether the ranges together contain a point."""


def read_next(top: Section, model: MeasurableModel | None) -> NextPlan | None:
    """The table; None where there is none. `model` is None where it is not known."""
    section = top.section(KEY)
    if KEY not in top:
        return None
    measurements = section.integer("readings", MEASUREMENTS)
    effects = _valid_effect_names(section, "effects", section.names("effects"))
    amounts = section.section("amount")
    sizes = {name: amounts.number(name, "", POSITIVE) for name in amounts.all_keys()}
    _valid_effect_names(amounts, "", sizes)
    for name in sizes if effects else ():
        if name not in effects:
            amounts.fault(name, f"is not among the effects of this table: {', '.join(effects)}")
    ranges = section.section("range")
    spans = {name: _span(ranges, name, model) for name in ranges.all_keys()}
    section.finish()
    valid = {name: span for name, span in spans.items() if span is not None}
    if model is not None and valid and len(valid) == len(spans):
        _reached(ranges, model, valid)
    return NextPlan(
        readings=NextPlan().readings if measurements is None else measurements,
        ranges=valid,
        effects=tuple(effects),
        amounts={name: size for name, size in sizes.items() if size is not None},
    )


def _valid_effect_names(section: Section, key: str, stated: Iterable[str] | None) -> list[str]:
    """The names that are effects; a fault for every name that is not."""
    known, names = registry.names("effects"), list(stated or ())
    for name in names:
        if name not in known:
            text = f"is not an effect{nearest(name, known)}"
            section.fault(key or name, f'"{name}" {text}' if key else text)
    return [name for name in names if name in known]


def _span(section: Section, name: str, model: MeasurableModel | None) -> Span | None:
    """The range of one input; None where it is at fault."""
    value = section.take(name)
    column = _column(section, name, model)
    unit = column.unit if column is not None else ""
    span = _interval_or_values(section, name, value, unit, column is not None and column.role is Role.DIRECTION)
    if span is None or column is None or model is None:
        return None
    _physical(section, column, model, span)
    return span


def _column(section: Section, name: str, model: MeasurableModel | None) -> Column | None:
    """The input of that name; a fault where there is none that can be chosen."""
    if model is None:
        return None
    known = {c.name: c for c in (*model.columns, *EXTRAS)}
    free = [n for n, c in known.items() if not c.text and c.role is not Role.REPEAT]
    column = known.get(name)
    if name in {output.name for output in model.outputs}:
        section.fault(name, "is measured, not chosen: name inputs only")
    elif column is None:
        section.fault(name, f"is not a column of the model{nearest(name, free)}")
    elif column.text or column.role is Role.REPEAT:
        section.fault(name, "holds labels: only inputs that are numbers have a range")
        return None
    elif isinstance(model, MeasuredTable) and name in {p for p, _ in model.predictions.values()}:
        section.fault(name, "is a prediction, not an input")
        return None
    return column


def _interval_or_values(section: Section, name: str, value: Any, unit: str, signs: bool) -> Span | None:
    """The interval or the set as it is written."""
    chosen = isinstance(value, dict)
    if chosen:
        inner = section.of(name, value)
        value = inner.take("values")
        inner.finish()
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        value, chosen = [value], True
    if not isinstance(value, list):
        section.fault(name, f"must be [low, high], a number, or {{ values = [...] }}, got {shown(value)}")
        return None
    if not value:
        section.fault(name, "is empty: give at least one value")
        return None
    numbers = [section.as_number(name, entry, unit) for entry in value]
    finite = [number for number in numbers if number is not None]
    if len(finite) < len(numbers):
        return None
    if chosen or signs:
        return Span(min(finite), max(finite), tuple(sorted(set(finite))))
    return _interval(section, name, finite)


def _interval(section: Section, name: str, ends: list[float]) -> Span | None:
    if len(ends) != 2:
        section.fault(name, f"must be [low, high], or {{ values = [...] }} for a set, got {len(ends)} numbers")
        return None
    low, high = ends
    if low > high:
        section.fault(name, f"goes from {low:g} down to {high:g}: write the lower end first")
        return None
    return Span(low, high)


def _physical(section: Section, column: Column, model: MeasurableModel, span: Span) -> None:
    """Faults of values that cannot be, or that are beyond the range of the model."""
    ends = np.array(span.values or (span.low, span.high))
    if column.role is Role.DIRECTION and not set(ends.tolist()) <= {-1.0, 1.0}:
        none = not set(ends.tolist()) & {-1.0, 1.0}
        text = "holds neither +1 nor -1" if none else f"must hold only +1 and -1, got {ends.tolist()}"
        section.fault(column.name, f"{text}; a direction is +1 or -1")
        return
    if column.role is Role.TEMPERATURE:
        zero = float(converted(ABSOLUTE_ZERO, "degC", column.unit))
        if (ends < zero).any():
            section.fault(column.name, f"{ends.min():g} is below absolute zero")
            return
    unknown = {c.name: np.full(len(ends), np.nan) for c in model.columns if not c.text}
    for wrong, text in model.outside({**unknown, column.name: ends}).values():
        if wrong.any():
            section.fault(column.name, f"{ends[wrong][0]:g} {text}; narrow the range")


def _reached(section: Section, model: MeasurableModel, spans: dict[str, Span]) -> None:
    """A fault where no point of the ranges is in the range of the model."""
    steps = np.linspace(0.0, 1.0, STEPS)
    axes = [
        np.array(span.values) if span.values else span.low + steps * (span.high - span.low) for span in spans.values()
    ]
    if len(axes) > 3 or prod(len(axis) for axis in axes) > MESH:
        return  # the points themselves are tested again
    mesh = np.meshgrid(*axes, indexing="ij")
    table = {name: axis.ravel() for name, axis in zip(spans, mesh, strict=True)}
    if not inside(model, table).any():
        section.fault("", f"holds no point that the model reaches: widen {' or '.join(spans)}")
