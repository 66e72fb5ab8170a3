"""Derivatives by the limits of parts that machines make."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...models.stack import Law
from .joint import joint_variations

if TYPE_CHECKING:
    from .problem import Stack

Array = NDArray[np.float64]
STEP = 1e-6
"""Relative step of a limit."""


def by_limit(stack: Stack, designs: Array, slopes: dict[str, Array]) -> dict[str, Array]:
    """Derivatives (n, parts) by tolerances: by differences where a machine makes the part."""
    parts = stack.definition.parts
    by_machine = [at for at, part in enumerate(parts) if part.by_machine]
    if not by_machine:
        return slopes
    found = {name: slope.copy() for name, slope in slopes.items()}
    for at in by_machine:
        column = stack.names.index(f"{parts[at].name}_t")
        step = STEP * designs[:, column]
        ends = []
        for side in (1.0, -1.0):
            moved = designs.copy()
            moved[:, column] += side * step
            ends.append(_linear_outputs(stack, moved))
        for name in found:
            found[name][:, at] = (ends[0][name] - ends[1][name]) / (2.0 * step)
    return found


def _linear_outputs(stack: Stack, designs: Array) -> dict[str, Array]:
    """The outputs (n,) that have derivatives, yields and half-widths by their laws."""
    t, coverage = stack.made(designs), stack.settings.propagation.coverage
    found: dict[str, Array] = {}
    for one in stack.measured:
        found |= one.variations(t) | one.margin(t)
        if isinstance(one.law, Law):
            found[one.name("yield_percent")] = one.law.yield_percent(t)[0]
            if one.requirement.method == "monte_carlo":
                found[one.name("variation")] = one.law.half_width(t, coverage)
        else:
            found[one.name("yield_percent")] = one.linear_yield(t)
    if stack.promises is not None:
        found |= stack.promises.outputs(t, True, stack.wanted)
    return found | joint_variations(stack.measured, found)
