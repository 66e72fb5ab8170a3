"""Derivatives by the limits of parts that machines make."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...arrays import Array
from .joint import joint_variations

if TYPE_CHECKING:
    from .problem import Stack

STEP = 1e-6
"""Relative step of a limit."""


def by_limit(stack: Stack, designs: Array, slopes: dict[str, Array]) -> dict[str, Array]:
    """Derivatives (n, parts) by tolerances: by differences where a machine makes the part."""
    parts = stack.definition.parts
    by_machine = [at for at, part in enumerate(parts) if part.by_machine]
    if not by_machine:
        return slopes
    derivatives = {name: slope.copy() for name, slope in slopes.items()}
    for at in by_machine:
        column = stack.names.index(f"{parts[at].name}_t")
        step = STEP * designs[:, column]
        ends = []
        for side in (1.0, -1.0):
            moved = designs.copy()
            moved[:, column] += side * step
            ends.append(_linear_outputs(stack, moved))
        for name in derivatives:
            derivatives[name][:, at] = (ends[0][name] - ends[1][name]) / (2.0 * step)
    return derivatives


def _linear_outputs(stack: Stack, designs: Array) -> dict[str, Array]:
    """The outputs (n,) that have derivatives, yields and half-widths by their laws."""
    t, coverage = stack.parts_as_made(designs), stack.settings.propagation.coverage
    outputs: dict[str, Array] = {}
    for measured in stack.measured:
        outputs |= measured.variations(t) | measured.margin(t)
        if (distribution := measured.distribution) is not None:
            outputs[measured.name("yield_percent")] = distribution.yield_percent(t)[0]
            if measured.requirement.method == "monte_carlo":
                outputs[measured.name("variation")] = distribution.half_width(t, coverage)
        else:
            outputs[measured.name("yield_percent")] = measured.linear_yield(t)
    if stack.promises is not None:
        outputs |= stack.promises.outputs(t, True, stack.required_outputs)
    return outputs | joint_variations(stack.measured, outputs)
