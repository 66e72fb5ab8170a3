"""Derivatives by differences: by the limits of parts that machines make, and of counted yields."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...arrays import Array
from .joint import joint_variations

if TYPE_CHECKING:
    from .problem import Stack

STEP = 1e-6
"""Relative step of a limit."""
WIDE = 0.05
"""Relative step of a tolerance for outputs that are counted: enough units must change sides."""


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


def by_count(stack: Stack, designs: Array) -> dict[str, Array]:
    """Derivatives (n, parts) of the required yields and half-widths where a formula is not described
    by its slopes at the mid-limits: by central differences, on the units of a report.
    """
    rough = [measured for measured in stack.measured if measured.rough]
    names = {measured.name(output) for measured in rough for output in ("yield_percent", "variation")}
    names = (names | ({"yield_percent"} if rough else set())) & stack.required_outputs
    names -= {measured.name("variation") for measured in rough if measured.requirement.method == "worst_case"}
    derivatives = {name: np.zeros((len(designs), len(stack.definition.parts))) for name in names}
    for at, part in enumerate(stack.definition.parts if names else ()):
        if part.low == part.high:
            continue
        column, ends = stack.names.index(f"{part.name}_t"), []
        for side in (1.0, -1.0):
            moved = designs.copy()
            moved[:, column] *= 1.0 + side * WIDE
            ends.append(stack.yields.outputs(stack.parts_as_made(moved), searching=False, needed=True))
        for name in names & set(ends[0]):
            derivatives[name][:, at] = (ends[0][name] - ends[1][name]) / (2.0 * WIDE * designs[:, column])
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
