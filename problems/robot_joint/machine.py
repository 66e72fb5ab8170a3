"""The manipulator over its task ring: maps of drives and links, and torques of a payload."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...arrays import Array
from ...declarations import number
from ...models.manipulator import declared
from ...models.manipulator.indices import quadrature
from ...models.manipulator.sources import NAMES, SCALES
from ...models.robot.manipulator import ORDER, drives, gravity_torque, links
from ...models.robot.sample import sobol_poses
from ..pose_accuracy.grouping import Grouping
from ..robot.machine import Machine, Places

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
        ring = declared.task_ring(self.parameters)
        return self._at(*quadrature(ring, index, ORDER))  # type: ignore[arg-type]

    def drawn(self, rng: np.random.Generator) -> Places:
        ring = declared.task_ring(self.parameters)
        low, high = (ring.r[0], ring.z[0]), (ring.r[1], ring.z[1])
        r, z = sobol_poses(low, high, rng).T
        if self.parameters["index"] == "rms_volume":
            fraction = (r - ring.r[0]) / (ring.r[1] - ring.r[0])
            r = np.sqrt(ring.r[0] ** 2 + fraction * (ring.r[1] ** 2 - ring.r[0] ** 2))
        return self._at(r, z, np.full(len(r), 1.0 / len(r)))

    def _at(self, r: Array, z: Array, weight: Array) -> Places:
        """The machine at poses r, z (n,) [m]."""
        manipulator = declared.manipulator(self.parameters)
        drives_at = drives(manipulator, r, z, weight)
        torque = gravity_torque(drives_at, number(self.parameters["payload_kg"]))[:, :JOINTS]
        maps = links(manipulator, r, z, str(self.parameters["calibrated"]))
        return Places(drives_at, torque, maps.move * SCALES, maps.turn * SCALES)
