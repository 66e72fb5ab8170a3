"""The links of the manipulator: 21 kinds of errors, seven for each of three chains."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

from ...declarations import Variable
from ...models.manipulator.sources import SOURCES
from ..pose_accuracy.grouping import Grouping, standard_deviation

KINDS: Mapping[str, tuple[tuple[str, ...], float]] = {
    "origin": (("origin_",), 10.0),
    "arm_length": (("arm_length_",), 10.0),
    "arm_orientation": (("arm_orientation_",), 0.1),
    "rod_length": (("rod_length_",), 10.0),
    "attachment": (("platform_attachment_",), 10.0),
    "joint_line": (("joint_line_",), 0.1),
    "joint_distance": (("joint_distance_",), 20.0),
}
"""Stems of the elementary errors of each kind, and the standard deviation of relative cost 1 [um,
or mrad of rotations]."""
UNITS = {source.name: source.unit for source in SOURCES}


def unit_of(source: str) -> str:
    """Unit of an elementary error."""
    return UNITS[source]


def kind_of(source: str) -> str:
    """The kind of an elementary error, of seven; empty for the drives' zeros."""
    return next((kind for kind, (stems, _) in KINDS.items() if source.startswith(stems)), "")


def reference_of(source: str) -> float:
    """Standard deviation of relative cost 1 of an elementary error."""
    return KINDS[kind_of(source)][1]


def _grouped() -> dict[str, tuple[str, ...]]:
    groups: dict[str, tuple[str, ...]] = {}
    for kind, source in product(KINDS, SOURCES):
        if kind_of(source.name) == kind:
            name = f"{kind}_{source.chain}_{source.unit}"
            groups[name] = (*groups.get(name, ()), source.name)
    return groups


TWENTY_ONE: Grouping = _grouped()
"""A standard deviation for each kind of each chain, which every elementary error of it has."""


def variables_of(grouping: Grouping) -> tuple[Variable, ...]:
    """The design variables of the links."""
    return tuple(
        standard_deviation(name, unit_of(sources[0]), reference_of(sources[0]), f"each of {', '.join(sources)}")
        for name, sources in grouping.items()
    )
