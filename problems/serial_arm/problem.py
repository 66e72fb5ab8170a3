"""Serial arms with a reducer in every joint: links and gears on one front."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...declarations import Assumption, Value, completed, number
from ...errors import Fault
from ...models.serial_arm.reach import blocking, singular
from ...section import Section
from ..declaration import ConfiguredProblem, Declaration
from ..interfaces import Written
from ..robot.definition import declaration_of
from ..robot.outputs import millimetres, share_name, sketched
from ..robot.problem import RobotProblem
from ..settings import Settings
from .definition import Definition
from .machine import ArmMachine
from .reading import read_definition
from .shipped import shipped_arm
from .writing import definition_tables

NAMED = 5
"""Most poses that are named; the others are counted."""
DECLARED: dict[str, Any] = {"model": "serial_arm", "tables": ("joint", "base", "tool", "cell"), "reducers_in": "joint"}


class SerialArmAllocation(RobotProblem, Written):
    """Pose accuracy of a serial arm with its reducers against cost: any chain of joints, one front.

    The arm is a Denavit-Hartenberg table in the configuration (`[[joint]]`, `[cell]`); five errors
    a joint, a reducer each: docs/serial_arm.md.
    """

    declaration = Declaration(parameters=shipped_arm().parameters, **DECLARED)
    definition: Definition

    def __init__(self, settings: Settings | None = None) -> None:
        given = settings or Settings()
        definition: Definition = given.definition or default_definition(given.parameters)
        self.declaration = _declared(definition)
        super().__init__(given, definition)
        self._machine = ArmMachine(self.settings.parameters, definition)

    @property
    def machine(self) -> ArmMachine:
        return self._machine

    @classmethod
    def configured(cls, top: Section) -> ConfiguredProblem | None:
        definition = read_definition(top)
        if definition is None:
            return None
        return ConfiguredProblem(_declared(definition), cls, {"definition": definition})

    def more_tables(self) -> dict[str, Any]:
        return definition_tables(self.definition, self.settings.parameters)

    def sketch(self) -> dict[str, Any]:
        now = self.machine.frames
        middle = int(np.argmin(np.sum((now.tool - now.tool.mean(axis=0)) ** 2, axis=1)))
        origin, chain = now.origin[middle], self.machine.chain
        parts: list[dict[str, Any]] = []
        for at in range(len(chain.d)):
            knee = origin[at] + chain.d[at] * now.axes[middle, at]
            names = [share_name(name) for name in self.link_names if f"_{at + 1}_" in name]
            parts.append(sketched(f"link {at + 1}", "link", [origin[at], knee, origin[at + 1]], names))
        for at in self.definition.gearings:
            parts.append(sketched(f"joint {at + 1}", "joint", [origin[at]], [f"share_joint_{at + 1}_percent"]))
        tool = sketched("tool", "tool", [origin[-1], now.tool[middle]])
        return {"parts": [*parts, tool], "poses": millimetres(list(now.tool))}

    # ---------------------------------------------------------------- faults and assumptions

    def misplacements(self) -> list[Fault]:
        return self._out_of_reach() or self._singular() or self._without_masses()

    def _out_of_reach(self) -> list[Fault]:
        reached, machine = self.machine.reached, self.machine
        why = blocking(machine.chain, reached, *self.definition.ends)
        messages = [
            (at, f"is out of reach by {1e3 * reached.missing[at]:.3g} mm: {text}")
            for at, text in enumerate(why)
            if text
        ]
        return self._at_poses(messages, "move or shrink the cell, or widen range_deg")

    def _singular(self) -> list[Fault]:
        joints = enumerate(singular(self.machine.chain, self.machine.frames))
        reason = "is singular: joints {} move the tool in the same direction"
        messages = [(at, reason.format(names)) for at, names in joints if names]
        return self._at_poses(messages, "move the cell, or give another posture (near_deg)")

    def _at_poses(self, messages: list[tuple[int, str]], remedy: str) -> list[Fault]:
        cell, tool = self.definition.cell, self.machine.frames.tool
        faults = []
        for at, text in messages[:NAMED]:
            key = "joints_deg" if cell.in_joints else "poses"
            place = f"cell.{key}[{at}]" if cell.listed else "cell"
            at_mm = np.round(1e3 * self._commanded(at, tool), 6) + 0.0  # no -0
            where = ", ".join(f"{coordinate:.4g}" for coordinate in at_mm)
            faults.append(Fault(place, f"pose {at + 1} ({where} mm) {text}; {remedy}"))
        if (more := len(messages) - NAMED) > 0:
            faults.append(Fault("cell", f"{more} more poses of {len(tool)} have such faults"))
        return faults

    def _commanded(self, at: int, tool: np.ndarray) -> np.ndarray:
        cell = self.definition.cell
        return np.asarray(tool[at] if cell.in_joints else cell.poses()[0][at])

    def _without_masses(self) -> list[Fault]:
        """Gravity determines no flank of an arm without masses."""
        if "gravity" not in self.machine.flanks:
            return []
        lacking = [at for at, joint in enumerate(self.definition.joints) if joint.mass is None]
        return [
            Fault(
                f"joint[{at}].mass_kg",
                "is missing: gravity holds flanks by the masses of the links; write 0 where there is none, or set "
                'parameters.flanks = "free"',
            )
            for at in lacking
        ]

    def assumptions(self) -> tuple[Assumption, ...]:
        definition, cell = self.definition, self.definition.cell
        assumed = [Assumption("joint", definition.shipped, "", "no table is given")] if definition.shipped else []
        if not cell.listed:
            shown = f"{cell.kind} of {1e3 * cell.side:g} mm"
            assumed.append(Assumption("cell", shown, "", "poses over which means are taken"))
        for key, gearing in zip((d.key for d in definition.drives), definition.gearings.values(), strict=True):
            for name in ("cost_factor", "backlash_factor"):
                if (value := getattr(gearing, name)) != 1.0:
                    reason = f"factor of the reducer of joint {key} over the reducer that its price is of"
                    assumed.append(
                        Assumption(f"joint[{int(key) - 1}].reducer.{name}", value, "", reason, "configuration")
                    )
        return (*super().assumptions(), *assumed)


def default_definition(parameters: Mapping[str, Value]) -> Definition:
    """The shipped arm."""
    given = completed(shipped_arm().parameters, parameters)
    return shipped_arm(bool(number(given["nested"])), bool(number(given["per_drive"])))


def _declared(definition: Definition) -> Declaration:
    return declaration_of(definition, parameters=definition.parameters, **DECLARED)
