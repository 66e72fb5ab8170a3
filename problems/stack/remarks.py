"""What the user of a stack is warned of before a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...likely_units import unit_hint
from ...models.machines.offers import departures
from ...models.stack import Tolerances, between
from ...units import family
from ..money import rising
from .definition import Part
from .linearity import linearity_warnings
from .measured import Measured
from .standards import price_remark

if TYPE_CHECKING:
    from .problem import Stack

Array = NDArray[np.float64]
FINEST, COARSEST = 1e-6, 0.25
"""Half-widths between which tolerances of lengths lie, as shares of the nominal size: from half of
IT01 at 500 mm to a quarter of the size.
"""
WARNING_SAMPLES = 131_072
"""Units at most by which warnings are judged before a run."""


def warnings_of(stack: Stack) -> tuple[str, ...]:
    """Unverified grades, formulas that leave their domain, linear models that mislead."""
    found = [
        f"part {part.name}: {why}"
        for part in stack.definition.parts
        for key, why in part.assumed.items()
        if key in ("grade", "fit")
    ]
    found += [text for part in stack.definition.parts if (text := _impossible(part))]
    each = [
        price_remark(part.name, part.processes, part.stated.get("price", {}))
        for part in stack.definition.parts
    ]
    found += [remark for remark in each if remark]
    for part in stack.definition.parts:
        for process in part.processes:
            name = f"{part.name} ({process.name})" if process.name else part.name
            found += [f"part {name}: {process.note}"] if process.note else []
            found += [note] if (note := rising(f"part {name}", process.curve)) else []
    for part in stack.definition.parts:
        found += () if part.sample is None else part.sample.departures(f"part {part.name}")
    for part in stack.definition.parts:
        found += departures(part.machines, f"part {part.name}")
    for one in stack.measured:
        found += [_domain(one)] if one.partial else []
        if one.mechanism.formula is not None:
            unit = f" {one.requirement.unit}".rstrip()
            sample = stack.yields.drawn(WARNING_SAMPLES)
            told = linearity_warnings(one.mechanism, one.linear, *_tried(stack, one), unit, sample)
            found += [
                f"{one.requirement.key}: {text}" if one.requirement.key else text for text in told
            ]
    return tuple(found)


def _impossible(part: Part) -> str:
    """A tolerance that hardly is one of the part's nominal size, with the unit it may be in."""
    size = abs(part.nominal or 0.0)
    if family(part.unit)[0] != "meter" or size == 0.0:
        return ""
    low, high = FINEST * size, COARSEST * size
    for t in (part.low, part.high):
        if 0.0 < t < low or t > high:
            hint = unit_hint(t, part.unit, low, high)
            return (
                f"part {part.name}: a tolerance of {t:g} {part.unit} is "
                f"{'small' if t < low else 'large'} for a size of {size:g} {part.unit}"
                f"{hint}"
            )
    return ""


def _domain(one: Measured) -> str:
    """Where the formula leaves its domain."""
    name = one.name("domain_margin")
    designs = f"designs that do are infeasible ({name} below 0)"
    if not one.bound_to_domain:
        designs = (
            f"{name} is below 0 for designs that do, and limits.{name} = 0 refuses them "
            f"({one.requirement.method} knows the formula by its slopes alone)"
        )
    return (
        f"{one.requirement.place}.formula leaves its domain within the widest tolerances: "
        f"{one.mechanism.undefined}; {designs}; units that do are non-conforming"
    )


def domain_remarks(measured: Sequence[Measured], front: pd.DataFrame) -> tuple[str, ...]:
    """Which reported points have a corner of their tolerances at which a formula has no value."""
    found = []
    for one in measured:
        name = one.name("domain_margin")
        below = int((front[name] < 0.0).sum()) if name in front and len(front) else 0
        if below:
            found.append(
                f"{below} of {len(front)} points leave the domain of "
                f"{one.requirement.place}.formula at a corner of their own tolerances "
                f"({name} down to {front[name].min():.3g}, 0 at the edge): units there "
                "have no value and do not conform"
            )
    return tuple(found)


def _tried(stack: Stack, one: Measured) -> tuple[Tolerances, str]:
    """The loosest design (1, p) that keeps the limits on the linear variations, and its name."""
    low, high = stack.ends_as_made
    line = between(low, high, np.linspace(0.0, 1.0, 257)[:, None])
    values = one.variations(line)
    if one.requirement.method == "monte_carlo":
        values.pop(one.name("variation"), None)
    kept = np.ones(len(line), dtype=bool)
    for limit in stack.limits:
        if limit.name in values:
            kept &= values[limit.name] <= limit.high
        elif one.partial and limit.name == one.name("domain_margin"):
            kept &= one.margin(line)[limit.name] >= limit.low
    if np.all(kept) or not np.any(kept):
        return high, "at the loosest tolerances"
    last = int(np.flatnonzero(kept)[-1])
    rss = float(one.linear.rss(line[last : last + 1])[0])
    return line[last : last + 1], f"at a variation of {rss:.4g} (rss)"
