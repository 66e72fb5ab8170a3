"""Proven bounds of the outputs of a stack."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .joint import joint_intervals
from .measured import Interval

if TYPE_CHECKING:
    from .problem import Stack


def intervals_of(stack: Stack) -> dict[str, Interval]:
    """Proven bounds of the outputs of every requirement, and of all together."""
    tightest, loosest = stack.ends_as_made
    intervals: dict[str, Interval] = {}
    for measured in stack.measured:
        intervals |= measured.intervals(tightest, loosest)
        if measured.partial:
            name = measured.name("domain_margin")
            most, least = (float(measured.margin(t)[name][0]) for t in (tightest, loosest))
            intervals[name] = least, most
    if stack.promises is not None:
        intervals |= stack.promises.intervals(tightest)
    most = min(intervals[measured.name("yield_percent")][1] for measured in stack.measured)
    joint = joint_intervals(stack.measured, intervals)
    return intervals | joint | {"yield_percent": (0.0, most)}
