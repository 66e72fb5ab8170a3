"""Several requirements together: the largest variation, the joint yield."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...arrays import Array
from .definition import Requirement
from .measured import Interval, Measured

VARIATIONS = ("variation", "worst_case", "rss")
"""Outputs of which the largest is taken, each times the weight of its requirement."""


def common_unit(requirements: Sequence[Requirement]) -> str | None:
    """The unit of all requirements, None where they differ."""
    units = {requirement.unit for requirement in requirements}
    return units.pop() if len(units) == 1 else None


def joint_variations(requirements: Sequence[Measured], values: Mapping[str, Array]) -> dict[str, Array]:
    """The largest weighted variation (n,) of several requirements of one unit, by kind."""
    if not requirements[0].requirement.key or common_unit([measured.requirement for measured in requirements]) is None:
        return {}
    return {
        kind: np.max([measured.requirement.weight * values[measured.name(kind)] for measured in requirements], axis=0)
        for kind in VARIATIONS
    }


def joint_slopes(
    requirements: Sequence[Measured], values: Mapping[str, Array], slopes: Mapping[str, Array]
) -> dict[str, Array]:
    """Derivatives (n, parts) of `joint_variations`: those of the largest."""
    largest_slopes = {}
    for kind, largest in joint_variations(requirements, values).items():
        if not all(measured.name(kind) in slopes for measured in requirements):
            continue
        weighted = [measured.requirement.weight * values[measured.name(kind)] for measured in requirements]
        at = np.argmax(np.array(weighted) == largest, axis=0)
        whole = np.stack([measured.requirement.weight * slopes[measured.name(kind)] for measured in requirements])
        largest_slopes[kind] = whole[at, np.arange(len(at))]
    return largest_slopes


def joint_intervals(requirements: Sequence[Measured], intervals: Mapping[str, Interval]) -> dict[str, Interval]:
    """Proven ends of `joint_variations` from those of the requirements."""
    joint = {}
    for kind in VARIATIONS if requirements[0].requirement.key else ():
        ends = [(measured.requirement.weight, intervals.get(measured.name(kind))) for measured in requirements]
        known = [(weight * low, weight * high) for weight, pair in ends if pair is not None for low, high in [pair]]
        if len(known) == len(requirements):
            joint[kind] = max(low for low, _ in known), max(high for _, high in known)
    return joint
