"""A serial arm over its cell: maps of joints and links, and torques of gravity."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...arrays import Array
from ...declarations import number
from ...models.robot.drives import WHOLE, Drives
from ...models.serial_arm import declared
from ...models.serial_arm.chain import Chain
from ...models.serial_arm.frames import Frames, frames
from ...models.serial_arm.gravity import gravity_torques
from ...models.serial_arm.inverse import Reached, over_cell
from ...units import MRAD, UM
from ..robot.machine import Machine, Places
from .definition import Definition

SCALES = np.array([MRAD if unit == "mrad" else UM for unit, _, _ in declared.ERRORS.values()])


@dataclass(frozen=True)
class ArmMachine(Machine):
    """The arm that the parameters of `serial_arm` mean."""

    definition: Definition

    @property
    def geared(self) -> int:
        return len(self.definition.gearings)

    @property
    def columns(self) -> list[list[int]]:
        every = [
            declared.error(kind, at) for at in range(1, len(self.definition.joints) + 1) for kind in declared.ERRORS
        ]
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
        return declared.chain_of(self.parameters)

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
        return over_cell(chain, position, turn, self.definition.near, *self.definition.ends)

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
            by_move, by_turn = _corrected(move, turn, by_move, by_turn)
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


def _corrected(move: Array, turn: Array, by_move: Array, by_turn: Array) -> tuple[Array, Array]:
    """The residual errors (n, 3, sources) when commands keep the position exact; the orientation
    as well where there are enough joints.
    """
    if move.shape[2] >= WHOLE:
        return np.zeros_like(by_move), np.zeros_like(by_turn)
    commands = np.linalg.pinv(move) @ by_move
    return np.zeros_like(by_move), by_turn - turn @ commands
