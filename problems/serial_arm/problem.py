"""A serial arm over its cell: maps of joints and links, and torques of gravity."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...errors import Fault
from ...models.robot import POSE_COORDINATES, Drives
from ...models.serial_arm import arm
from ...models.serial_arm.kinematics import (
    Chain,
    Frames,
    Reached,
    blocking_joints,
    frames,
    gravity_torques,
    inverse_over_cell,
    singular_joints,
)
from ...section import Array, Assumption, Section, Value, completed, number
from ...units import MRAD, UM
from ..declaration import ConfiguredProblem, Declaration
from ..robot.machine import Machine, Places
from ..robot.problem import RobotProblem, declaration_of, millimetres, share_name, sketch_part
from ..settings import Settings
from .definition import Definition, definition_tables, read_definition, shipped_arm

SCALES = np.array([MRAD if unit == "mrad" else UM for unit, _, _ in arm.ERRORS.values()])


@dataclass(frozen=True)
class ArmMachine(Machine):
    """The arm that the parameters of `serial_arm` mean."""

    definition: Definition

    @property
    def geared(self) -> int:
        return len(self.definition.gearings)

    @property
    def columns(self) -> list[list[int]]:
        every = [arm.error(kind, at) for at in range(1, len(self.definition.joints) + 1) for kind in arm.ERRORS]
        return [[every.index(name)] for name in self.definition.links]

    @property
    def friction(self) -> Array:
        return self.definition.of_joints("friction", self.parameters, "friction_torque_Nm")

    @property
    def stiffness(self) -> Array:
        return self.definition.of_joints("stiffness", self.parameters, "stiffness_Nm_per_arcmin")

    @property
    def flanks(self) -> tuple[str, ...]:
        usual = str(self.parameters["flanks"])
        return tuple(gearing.flank or usual for gearing in self.definition.gearings.values())

    @cached_property
    def chain(self) -> Chain:
        """The nominal chain, with the results of a recalibration."""
        return arm.chain_of(self.parameters)

    @cached_property
    def reached(self) -> Reached:
        """The joints at the poses of the cell."""
        return self._reach(*self.definition.cell.poses())

    def _reach(self, position: Array, turn: Array) -> Reached:
        cell, chain = self.definition.cell, self.chain
        if cell.in_joints:
            angles = np.array(cell.listed)
            return Reached(angles, np.zeros(len(angles)))
        if not cell.of_tool:
            position = position + np.einsum("nij,j->ni", turn, chain.tool)
        return inverse_over_cell(chain, position, turn, self.definition.near, *self.definition.ends)

    @cached_property
    def frames(self) -> Frames:
        """The frames at the poses of the cell."""
        return frames(self.chain, self.reached.angles)

    @cached_property
    def places(self) -> Places:
        return self._at(self.frames)

    def drawn(self, rng: np.random.Generator) -> Places:
        return self.places

    @property
    def _order(self) -> list[int]:
        """Joints, those with a reducer first."""
        geared = list(self.definition.gearings)
        return geared + [at for at in range(len(self.definition.joints)) if at not in geared]

    def _at(self, now: Frames) -> Places:
        joints, order = self.definition.joints, self._order
        move, turn = now.joints()
        by_move, by_turn = now.errors()
        scale = np.tile(SCALES, len(joints))
        by_move, by_turn = by_move * scale, by_turn * scale
        if self.calibrated:
            by_move, by_turn = _correct_errors(move, turn, by_move, by_turn)
        weight = np.full(len(move), 1.0 / len(move))
        mass = np.array([joint.mass or 0.0 for joint in joints])
        centre = np.array([joint.centre for joint in joints])
        payload = number(self.parameters["payload_kg"])
        torque = gravity_torques(now, mass, centre, payload)[:, order[: self.geared]]
        to_tool = np.swapaxes(now.turn[:, -1], 1, 2)  # rotations about the axes of the tool
        maps = (move[:, :, order], (to_tool @ turn)[:, :, order], by_move, to_tool @ by_turn)
        # in one order in memory, so that a copy in another process rounds alike
        by_joint, turned, moved, rotated = (np.ascontiguousarray(array) for array in maps)
        return Places(Drives(weight, by_joint, turned), np.ascontiguousarray(torque), moved, rotated)


def _correct_errors(move: Array, turn: Array, by_move: Array, by_turn: Array) -> tuple[Array, Array]:
    """The residual errors (n, 3, sources) when commands keep the position exact; the orientation
    as well where there are enough joints.
    """
    if move.shape[2] >= POSE_COORDINATES:
        return np.zeros_like(by_move), np.zeros_like(by_turn)
    commands = np.linalg.pinv(move) @ by_move
    return np.zeros_like(by_move), by_turn - turn @ commands


# Serial arms with a reducer in every joint: links and gears on one front.


NAMED = 5
"""Most poses that are named; the others are counted."""
DECLARED: dict[str, Any] = {"model": "serial_arm", "tables": ("joint", "base", "tool", "cell"), "reducers_in": "joint"}


class SerialArmAllocation(RobotProblem):
    """Pose accuracy of a serial arm with its reducers against cost: any chain of joints, one front.

    The arm is a Denavit-Hartenberg table in the configuration (`[[joint]]`, `[cell]`); five errors
    a joint, a reducer each: docs/serial_arm.md.
    """

    declaration = Declaration(parameters=shipped_arm().parameters, **DECLARED)
    definition: Definition

    def __init__(self, settings: Settings | None = None) -> None:
        given = settings or Settings()
        definition: Definition = given.definition or default_definition(given.parameters)
        self.declaration = _declare_arm(definition)
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
        return ConfiguredProblem(_declare_arm(definition), cls, {"definition": definition})

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
            parts.append(sketch_part(f"link {at + 1}", "link", [origin[at], knee, origin[at + 1]], names))
        for at in self.definition.gearings:
            parts.append(sketch_part(f"joint {at + 1}", "joint", [origin[at]], [f"share_joint_{at + 1}_percent"]))
        tool = sketch_part("tool", "tool", [origin[-1], now.tool[middle]])
        return {"parts": [*parts, tool], "poses": millimetres(list(now.tool))}

    # ---------------------------------------------------------------- faults and assumptions

    def misplacements(self) -> list[Fault]:
        return self._out_of_reach() or self._singular() or self._without_masses()

    def _out_of_reach(self) -> list[Fault]:
        reached, machine = self.machine.reached, self.machine
        why = blocking_joints(machine.chain, reached, *self.definition.ends)
        messages = [
            (at, f"is out of reach by {1e3 * reached.missing[at]:.3g} mm: {text}")
            for at, text in enumerate(why)
            if text
        ]
        stopped = any("end of its range" in text for text in why)
        return self._at_poses(messages, f"move or shrink the cell{', or widen range_deg' if stopped else ''}")

    def _singular(self) -> list[Fault]:
        joints = enumerate(singular_joints(self.machine.chain, self.machine.frames))
        one, several = "joint {} does not move the tool", "joints {} move the tool in the same direction"
        messages = [
            (at, f"is singular: {(several if ' ' in names else one).format(names)}") for at, names in joints if names
        ]
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


def _declare_arm(definition: Definition) -> Declaration:
    return declaration_of(definition, parameters=definition.parameters, **DECLARED)
