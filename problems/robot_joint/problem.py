"""The manipulator of document M with reducers: links and gears on one front."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import Fault
from ...models.manipulator import declared
from ...models.manipulator.faults import faults
from ...models.manipulator.inverse import posture
from ...section import Section
from ..declaration import ConfiguredProblem, Declaration
from ..interfaces import Written
from ..pose_accuracy.grouping import read_grouping
from ..reducers.documents import documents_reducer
from ..robot.definition import declaration_of
from ..robot.outputs import millimetres, share_name, sketched
from ..robot.problem import RobotProblem
from ..settings import Settings
from .definition import Definition, default_definition
from .links import TWENTY_ONE, unit_of
from .machine import JOINTS, RingMachine
from .outputs import PARAMETERS

OF_ARMS = ("origin_", "arm_length_", "arm_orientation_", "joint_distance_", "joint_line_")
OF_RODS = ("rod_length_", "platform_attachment_")
"""Elementary errors that are drawn with the arm of their chain, and with its rods."""
REDUCERS = ("1", "2")
"""Keys of `[reducers]`: the drives that have one."""
DECLARED: dict[str, Any] = {"parameters": PARAMETERS, "model": "manipulator_pose", "reducers": REDUCERS}


class RobotJoint(RobotProblem, Written):
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
        return declared.manipulator(self.settings.parameters)

    def misplacements(self) -> list[Fault]:
        return faults(self.machine_of(), declared.task_ring(self.settings.parameters))

    def sketch(self) -> dict[str, Any]:
        """The chains in the middle of the ring, at azimuth 0; drive 3 has no reducer."""
        machine, ring = self.machine_of(), declared.task_ring(self.settings.parameters)
        r, z = (np.asarray(0.5 * (ends[0] + ends[1])) for ends in (ring.r, ring.z))
        now = posture(machine, r, z)
        parts: list[dict[str, Any]] = []
        for at in range(len(machine.arms)):
            hip = machine.origins[at]
            elbow = hip + machine.arms[at] * now.u[at]
            end = elbow + machine.rods[at] * now.w[at]
            parts.append(sketched(f"arm {at + 1}", "link", [hip, elbow], self._shares(OF_ARMS, at + 1)))
            parts.append(sketched(f"rod {at + 1}", "link", [elbow, end], self._shares(OF_RODS, at + 1)))
        for at in range(JOINTS):  # on one column
            point = machine.origins[at] + [0.0, 0.0, -0.04 * at]
            parts.append(sketched(f"joint {at + 1}", "joint", [point], [f"share_joint_{at + 1}_percent"]))
        corners = [(a, 0.0, b) for a in ring.r for b in ring.z]
        ends = [p + np.array([r, 0.0, z]) for p in now.p]
        return {"parts": [*parts, sketched("platform", "tool", [*ends, ends[0]])], "poses": millimetres(corners)}

    def _shares(self, stems: tuple[str, ...], chain: int) -> list[str]:
        """Columns of the fractions of a chain's link variables whose elementary errors begin so."""
        return [
            share_name(name)
            for name, sources in self.definition.grouping.items()
            if sources[0].startswith(stems) and f"_{chain}" in sources[0]
        ]
