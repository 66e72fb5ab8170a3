"""What several requirements come to together: the largest variation, the joint yield."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .definition import Requirement
from .measured import Interval, Measured

Array = NDArray[np.float64]
VARIATIONS = ("variation", "worst_case", "rss")
"""Outputs of which the largest is taken, each times the weight of its requirement."""


def common_unit(requirements: Sequence[Requirement]) -> str | None:
    """The unit of all requirements, None where they differ."""
    units = {one.unit for one in requirements}
    return units.pop() if len(units) == 1 else None


def joint_variations(each: Sequence[Measured], values: Mapping[str, Array]) -> dict[str, Array]:
    """The largest weighted variation (n,) of several requirements of one unit, by kind."""
    if not each[0].requirement.key or common_unit([one.requirement for one in each]) is None:
        return {}
    return {
        kind: np.max([one.requirement.weight * values[one.name(kind)] for one in each], axis=0)
        for kind in VARIATIONS
    }


def joint_slopes(
    each: Sequence[Measured], values: Mapping[str, Array], slopes: Mapping[str, Array]
) -> dict[str, Array]:
    """Derivatives (n, parts) of `joint_variations`: those of the largest."""
    found = {}
    for kind, largest in joint_variations(each, values).items():
        if not all(one.name(kind) in slopes for one in each):
            continue
        weighted = [one.requirement.weight * values[one.name(kind)] for one in each]
        at = np.argmax(np.array(weighted) == largest, axis=0)
        whole = np.stack([one.requirement.weight * slopes[one.name(kind)] for one in each])
        found[kind] = whole[at, np.arange(len(at))]
    return found


def joint_intervals(
    each: Sequence[Measured], intervals: Mapping[str, Interval]
) -> dict[str, Interval]:
    """Proven ends of `joint_variations` from those of the requirements."""
    found = {}
    for kind in VARIATIONS if each[0].requirement.key else ():
        ends = [(one.requirement.weight, intervals.get(one.name(kind))) for one in each]
        known = [
            (weight * low, weight * high)
            for weight, pair in ends
            if pair is not None
            for low, high in [pair]
        ]
        if len(known) == len(each):
            found[kind] = max(low for low, _ in known), max(high for _, high in known)
    return found
