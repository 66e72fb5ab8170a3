"""The links of the manipulator: 21 kinds of errors, seven for each of three chains."""

from __future__ import annotations

from collections.abc import Mapping

from ...declarations import Kind, Variable
from ...models.costs import CostCurve, Reciprocal
from ...models.manipulator.sources import SOURCES
from ..pose_accuracy.grouping import RANGE, Grouping

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
    """Which of the seven kinds an elementary error belongs to; empty for the drives' zeros."""
    return next((kind for kind, (stems, _) in KINDS.items() if source.startswith(stems)), "")


def reference_of(source: str) -> float:
    """Standard deviation of relative cost 1 of an elementary error."""
    return KINDS[kind_of(source)][1]


def _grouped() -> dict[str, tuple[str, ...]]:
    groups: dict[str, list[str]] = {}
    for kind in KINDS:
        for source in SOURCES:
            if kind_of(source.name) == kind:
                name = f"{kind}_{source.chain}_{source.unit}"
                groups.setdefault(name, []).append(source.name)
    return {name: tuple(sources) for name, sources in groups.items()}


TWENTY_ONE: Grouping = _grouped()
"""A standard deviation for each kind of each chain, which every elementary error of it has."""


def variables_of(grouping: Grouping) -> tuple[Variable, ...]:
    """The design variables of the links."""
    return tuple(_variable(name, sources) for name, sources in grouping.items())


def _variable(name: str, sources: tuple[str, ...]) -> Variable:
    reference = reference_of(sources[0])
    low, high = (reference * factor for factor in RANGE)
    return Variable(
        name,
        unit_of(sources[0]),
        Kind.STANDARD_DEVIATION,
        low,
        high,
        "standard deviation of each of " + ", ".join(sources),
        valid_low=1e-9,
    )


def costs_of(grouping: Grouping) -> dict[str, CostCurve]:
    """Relative costs reference/sigma; all of them assumptions."""
    return {name: Reciprocal(0.0, reference_of(sources[0])) for name, sources in grouping.items()}
