"""Links and reducers of the manipulator as one machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from ..errors import Fault
from ..models.costs import CostCurve
from ..models.manipulator import pose
from ..models.manipulator.geometry import posture
from ..models.manipulator.maps import NAMES, SCALES, SOURCES
from ..models.manipulator.pose import faults
from ..models.manipulator.ring import quadrature
from ..models.robot import ORDER, drives, gravity_torque, links, sobol_poses
from ..section import Array, Parameter, Section, Value, Variable, completed, number
from .declaration import ConfiguredProblem, Declaration
from .nested_reducers import Nested, documents_reducer
from .pose_accuracy.outputs import Grouping, costs_of, read_grouping, standard_deviation
from .robot import problem
from .robot.machine import Machine, Places
from .robot.problem import PARAMETERS as OF_ROBOTS
from .robot.problem import Drive, RobotProblem, declaration_of, millimetres, share_name, sketch_part
from .settings import Settings

__all__ = ["RobotJoint"]

# The links of the manipulator: 21 kinds of errors, seven for each of three chains.


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


def _default_groups() -> dict[str, tuple[str, ...]]:
    groups: dict[str, tuple[str, ...]] = {}
    for kind, source in product(KINDS, SOURCES):
        if kind_of(source.name) == kind:
            name = f"{kind}_{source.chain}_{source.unit}"
            groups[name] = (*groups.get(name, ()), source.name)
    return groups


TWENTY_ONE: Grouping = _default_groups()
"""A standard deviation for each kind of each chain, which every elementary error of it has."""


def variables_of(grouping: Grouping) -> tuple[Variable, ...]:
    """The design variables of the links."""
    return tuple(
        standard_deviation(name, unit_of(sources[0]), reference_of(sources[0]), f"each of {', '.join(sources)}")
        for name, sources in grouping.items()
    )


# Parameters of machine and drives that `robot_joint` declares.


_INDICES = ("rms_plane", "rms_volume")
_MACHINE = {
    "index": {
        "default": "rms_plane",
        "choices": _INDICES,
        "source": "",
        "meaning": "mean over the ring: root mean square by the plane's area or by volume",
    },
    "follow_up": {
        "default": "rod",
        "choices": ("rod",),
        "source": "",
        "assumed": False,
        "meaning": "follow-up plane of chain 3, turned by its rod (M2); at the azimuth "
        "commanded (M1) the yaw of drives 1 and 2 would be lost",
    },
}
PARAMETERS: tuple[Parameter, ...] = (
    *(replace(p, **_MACHINE.get(p.name, {})) for p in pose.PARAMETERS),  # type: ignore[arg-type]
    *OF_ROBOTS,
)


# The definition of a machine that a configuration of `robot_joint` states.


@dataclass(frozen=True)
class Definition(problem.Definition):
    """Grouping of the links' errors, the reducers of drives 1 and 2, and how they enter."""

    grouping: Grouping
    reducers: tuple[Nested, ...]
    nested: bool = True
    per_drive: bool = True

    @property
    def drives(self) -> tuple[Drive, ...]:
        return tuple(Drive(str(at), reducer) for at, reducer in enumerate(self.reducers, 1))

    @property
    def link_variables(self) -> tuple[Variable, ...]:
        return variables_of(self.grouping)

    @property
    def link_costs(self) -> Mapping[str, CostCurve]:
        return costs_of(self.grouping, reference_of)

    @property
    def link_references(self) -> Mapping[str, float]:
        return {name: reference_of(sources[0]) for name, sources in self.grouping.items()}


def default_definition(parameters: Mapping[str, Value]) -> Definition:
    """Links in 21 kinds, and reducers of document B."""
    given = completed(PARAMETERS, parameters)
    return Definition(
        TWENTY_ONE, (documents_reducer(),) * 2, bool(number(given["nested"])), bool(number(given["per_drive"]))
    )


# The manipulator over its task ring: maps of drives and links, and torques of a payload.


JOINTS = 2
"""Drives with a reducer; drive 3 is direct."""


@dataclass(frozen=True)
class RingMachine(Machine):
    """The machine that the parameters of `robot_joint` mean."""

    grouping: Grouping

    @property
    def geared(self) -> int:
        return JOINTS

    @property
    def columns(self) -> list[list[int]]:
        return [[NAMES.index(source) for source in sources] for sources in self.grouping.values()]

    @cached_property
    def places(self) -> Places:
        index = str(self.parameters["index"])
        ring = pose.task_ring(self.parameters)
        return self._at(*quadrature(ring, index, ORDER))  # type: ignore[arg-type]

    def drawn(self, rng: np.random.Generator) -> Places:
        ring = pose.task_ring(self.parameters)
        low, high = (ring.r[0], ring.z[0]), (ring.r[1], ring.z[1])
        r, z = sobol_poses(low, high, rng).T
        if self.parameters["index"] == "rms_volume":
            fraction = (r - ring.r[0]) / (ring.r[1] - ring.r[0])
            r = np.sqrt(ring.r[0] ** 2 + fraction * (ring.r[1] ** 2 - ring.r[0] ** 2))
        return self._at(r, z, np.full(len(r), 1.0 / len(r)))

    def _at(self, r: Array, z: Array, weight: Array) -> Places:
        """The machine at poses r, z (n,) [m]."""
        manipulator = pose.manipulator(self.parameters)
        drives_at = drives(manipulator, r, z, weight)
        torque = gravity_torque(drives_at, number(self.parameters["payload_kg"]))[:, :JOINTS]
        maps = links(manipulator, r, z, str(self.parameters["calibrated"]))
        return Places(drives_at, torque, maps.move * SCALES, maps.turn * SCALES)


# The manipulator of document M with reducers: links and gears on one front.


OF_ARMS = ("origin_", "arm_length_", "arm_orientation_", "joint_distance_", "joint_line_")
OF_RODS = ("rod_length_", "platform_attachment_")
"""Elementary errors that are drawn with the arm of their chain, and with its rods."""
REDUCERS = ("1", "2")
"""Keys of `[reducers]`: the drives that have one."""
DECLARED: dict[str, Any] = {"parameters": PARAMETERS, "model": "manipulator_pose", "reducers": REDUCERS}


class RobotJoint(RobotProblem):
    """Pose accuracy of the manipulator with its reducers against cost: one machine, one front.

    Links by standard deviations of their errors, reducers by what an rms of their backlash and of
    their transmission error costs (`[reducers]`): docs/robot_joint.md.
    """

    declaration = Declaration(**DECLARED)
    definition: Definition

    def __init__(self, settings: Settings | None = None) -> None:
        given = settings or Settings()
        definition: Definition = given.definition or default_definition(given.parameters)
        self.declaration = declaration_of(definition, **DECLARED)
        super().__init__(given, definition)
        self._machine = RingMachine(self.settings.parameters, definition.grouping)

    @property
    def machine(self) -> RingMachine:
        return self._machine

    @classmethod
    def configured(cls, top: Section) -> ConfiguredProblem | None:
        grouping = read_grouping(top, TWENTY_ONE, unit_of, "an error of a link")
        reducers = top.take("reducers")
        flags = top.section("parameters")
        nested, per_drive = flags.take("nested"), flags.take("per_drive")
        if grouping is None or (reducers is not None and not isinstance(reducers, tuple)):
            return None
        pair = reducers or (documents_reducer(),) * 2
        definition = Definition(grouping, pair, nested is not False, per_drive is not False)
        if not definition.nested and not all(reducer.proven for reducer in pair):
            top.fault(
                "reducers",
                "nested = false needs reducers whose tolerances are known: name configurations of rv_backlash",
            )
            return None
        declaration = declaration_of(definition, **DECLARED)
        return ConfiguredProblem(declaration, cls, {"definition": definition})

    def more_tables(self) -> dict[str, Any]:
        definition = self.definition
        tables: dict[str, Any] = {
            "reducers": {key: reducer.tables for key, reducer in zip(REDUCERS, definition.reducers, strict=True)}
        }
        if definition.grouping != TWENTY_ONE:
            tables["grouping"] = {name: list(sources) for name, sources in definition.grouping.items()}
        return tables

    def machine_of(self) -> Any:
        """The nominal manipulator."""
        return pose.manipulator(self.settings.parameters)

    def misplacements(self) -> list[Fault]:
        return faults(self.machine_of(), pose.task_ring(self.settings.parameters))

    def sketch(self) -> dict[str, Any]:
        """The chains in the middle of the ring, at azimuth 0; drive 3 has no reducer."""
        machine, ring = self.machine_of(), pose.task_ring(self.settings.parameters)
        r, z = (np.asarray(0.5 * (ends[0] + ends[1])) for ends in (ring.r, ring.z))
        now = posture(machine, r, z)
        parts: list[dict[str, Any]] = []
        for at in range(len(machine.arms)):
            hip = machine.origins[at]
            elbow = hip + machine.arms[at] * now.u[at]
            end = elbow + machine.rods[at] * now.w[at]
            parts.append(sketch_part(f"arm {at + 1}", "link", [hip, elbow], self._shares(OF_ARMS, at + 1)))
            parts.append(sketch_part(f"rod {at + 1}", "link", [elbow, end], self._shares(OF_RODS, at + 1)))
        for at in range(JOINTS):  # on one column
            point = machine.origins[at] + [0.0, 0.0, -0.04 * at]
            parts.append(sketch_part(f"joint {at + 1}", "joint", [point], [f"share_joint_{at + 1}_percent"]))
        corners = [(a, 0.0, b) for a in ring.r for b in ring.z]
        ends = [p + np.array([r, 0.0, z]) for p in now.p]
        return {"parts": [*parts, sketch_part("platform", "tool", [*ends, ends[0]])], "poses": millimetres(corners)}

    def _shares(self, stems: tuple[str, ...], chain: int) -> list[str]:
        """Columns of the fractions of a chain's link variables whose elementary errors begin so."""
        return [
            share_name(name)
            for name, sources in self.definition.grouping.items()
            if sources[0].startswith(stems) and f"_{chain}" in sources[0]
        ]
