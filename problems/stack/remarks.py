"""Warnings to the user of a stack before a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ...arrays import Array
from ...likely_units import unit_hint
from ...models.machines.offers import departures
from ...models.stack import Tolerances, between, yield_percent
from ...units import family
from ..limits import keeps
from ..money import rising
from .definition import Part
from .linearity import linearity_warnings
from .measured import Measured
from .standards import price_remark

if TYPE_CHECKING:
    from .problem import Stack

FINEST, COARSEST = 1e-6, 0.25
"""Half-widths between which tolerances of lengths lie, as fractions of the nominal size: from
half of IT01 at 500 mm to a quarter of the size.
"""
WARNING_SAMPLES = 131_072
"""Most units with which warnings are tested before a run."""


def warnings_of(stack: Stack) -> tuple[str, ...]:
    """Unverified grades, formulas that leave their domain, linear models that mislead."""
    sentences = [
        f"part {part.name}: {why}"
        for part in stack.definition.parts
        for key, why in part.assumed.items()
        if key in ("grade", "fit")
    ]
    sentences += [text for part in stack.definition.parts if (text := _impossible(part))]
    remarks = [price_remark(part.name, part.processes, part.stated.get("price", {})) for part in stack.definition.parts]
    sentences += filter(None, remarks)
    for part in stack.definition.parts:
        for process in part.processes:
            name = f"{part.name} ({process.name})" if process.name else part.name
            sentences += [f"part {name}: {process.note}"] if process.note else []
            sentences += [note] if (note := rising(f"part {name}", process.curve)) else []
    for part in stack.definition.parts:
        sentences += () if part.sample is None else part.sample.departures(f"part {part.name}")
    for part in stack.definition.parts:
        sentences += departures(part.machines, f"part {part.name}")
    for measured in stack.measured:
        if text := measured.off_nominal:
            most = "fewer than half of the units conform whatever the tolerances" if measured.off_limits else ""
            sentences.append(
                f"{measured.requirement.place} {text}: {most or 'the tolerances are not what breaks its limits'}; move "
                "the nominal values or the limits"
            )
        sentences += [_domain(measured)] if measured.partial else []
        sentences += [_rough(stack, measured)] if measured.rough else []
        if measured.mechanism.formula is not None and not measured.rough:
            unit = f" {measured.requirement.unit}".rstrip()
            sample = stack.yields.drawn(WARNING_SAMPLES)
            warnings = linearity_warnings(
                measured.mechanism, measured.linear, *_loosest_feasible(stack, measured), unit, sample
            )
            sentences += [
                f"{measured.requirement.key}: {text}" if measured.requirement.key else text for text in warnings
            ]
    return tuple(sentences)


def _impossible(part: Part) -> str:
    """A note on a tolerance that is implausible for the nominal size, with the unit it may be in."""
    size = abs(part.nominal or 0.0)
    if family(part.unit)[0] != "meter" or size == 0.0:
        return ""
    low, high = FINEST * size, COARSEST * size
    for t in (part.low, part.high):
        if 0.0 < t < low or t > high:
            hint = unit_hint(t, part.unit, low, high)
            extreme = "small" if t < low else "large"
            tolerance = f"part {part.name}: a tolerance of {t:g} {part.unit}"
            return f"{tolerance} is {extreme} for a size of {size:g} {part.unit}{hint}"
    return ""


def _domain(measured: Measured) -> str:
    """Where the formula leaves its domain."""
    name = measured.name("domain_margin")
    designs = f"designs that do are infeasible ({name} below 0)"
    if not measured.bound_to_domain:
        designs = (
            f"{name} is below 0 for designs that do, and limits.{name} = 0 refuses them "
            f"({measured.requirement.method} knows the formula by its slopes alone)"
        )
    return (
        f"{measured.requirement.place}.formula leaves its domain within the widest tolerances: "
        f"{measured.mechanism.undefined}; {designs}; units that do are non-conforming"
    )


def _rough(stack: Stack, measured: Measured) -> str:
    """What is not given of a formula that its slopes at the mid-limits do not describe, and what is."""
    mechanism, unit = measured.mechanism, f" {measured.requirement.unit}".rstrip()
    _, loosest = stack.ends_as_made
    first, worst = (float(values[0]) for values in (measured.linear.worst_case(loosest), _worst(measured, loosest)))
    text = (
        f"{measured.requirement.place}.formula has no slope at the mid-limits (0, not defined, or another one on each "
        f"side) by {', '.join(mechanism.rough)}: no root sum square and no contributions are given; worst_case is that "
        f"of the corners, {worst:.4g}{unit} at the loosest tolerances (first order: {first:.4g}{unit})"
    )
    if mechanism.bounded:
        percent, error = yield_percent(mechanism, loosest, stack.yields.drawn(WARNING_SAMPLES))
        text += f"; {percent[0]:.3f} % of the units (standard error {error[0]:.1g} %) are then within the limits"
    return text


def _worst(measured: Measured, t: Tolerances) -> Array:
    return measured.variations(t)[measured.name("worst_case")]


def domain_remarks(requirements: Sequence[Measured], front: pd.DataFrame) -> tuple[str, ...]:
    """Which reported points have a corner of their tolerances at which a formula has no value."""
    sentences = []
    for measured in requirements:
        name = measured.name("domain_margin")
        below = int((front[name] < 0.0).sum()) if name in front and len(front) else 0
        if below:
            sentences.append(
                f"{below} of {len(front)} points leave the domain of {measured.requirement.place}.formula at a corner "
                f"of their tolerances ({name} down to {front[name].min():.3g}, 0 at the edge): units there have no "
                "value and do not conform"
            )
    return tuple(sentences)


def _loosest_feasible(stack: Stack, measured: Measured) -> tuple[Tolerances, str]:
    """The loosest design (1, p) that keeps the limits on the linear variations, and its name."""
    low, high = stack.ends_as_made
    line = between(low, high, np.linspace(0.0, 1.0, 257)[:, None])
    values = measured.variations(line)
    if measured.requirement.method == "monte_carlo":
        values.pop(measured.name("variation"), None)
    kept = np.ones(len(line), dtype=bool)
    for limit in stack.limits:
        if limit.name in values:
            kept &= keeps(values[limit.name], limit.high)
        elif measured.partial and limit.name == measured.name("domain_margin"):
            kept &= limit.kept(measured.margin(line)[limit.name])
    if np.all(kept) or not np.any(kept):
        return high, "at the loosest tolerances"
    last = int(np.flatnonzero(kept)[-1])
    rss = float(measured.linear.rss(line[last : last + 1])[0])
    return line[last : last + 1], f"at a variation of {rss:.4g} (rss)"
