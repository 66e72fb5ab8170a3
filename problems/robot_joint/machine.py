"""What errors of links and reducers do at the platform: mean squares over the task ring."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...declarations import Value, number
from ...models.manipulator import declared
from ...models.manipulator.indices import quadrature
from ...models.manipulator.sources import NAMES, SCALES
from ...models.robot.drives import Drives
from ...models.robot.manipulator import ORDER, drives, gravity_torque, links
from ...models.robot.sample import AccuracySample, sobol_poses
from ...units import ARCMIN, MM, MRAD
from ..pose_accuracy.grouping import Grouping

Array = NDArray[np.float64]
JOINTS = 2
"""Drives with a reducer; drive 3 is direct."""


@dataclass(frozen=True)
class Machine:
    """The machine that a problem's parameters mean."""

    parameters: Mapping[str, Value]
    grouping: Grouping

    @cached_property
    def _places(self) -> tuple[Array, Array, Array]:
        index = str(self.parameters["index"])
        ring = declared.task_ring(self.parameters)
        return quadrature(ring, index, ORDER)  # type: ignore[arg-type]

    @cached_property
    def drives(self) -> Drives:
        """Maps of the three drives over the task ring."""
        return drives(declared.manipulator(self.parameters), *self._places)

    @cached_property
    def _columns(self) -> list[list[int]]:
        return [[NAMES.index(one) for one in own] for own in self.grouping.values()]

    @cached_property
    def links(self) -> Array:
        """Mean squares (3, variables) of position, squareness and yaw [mm^2, mrad^2 per unit^2]."""
        r, z, weight = self._places
        given = declared.manipulator(self.parameters)
        maps = links(given, r, z, str(self.parameters["calibrated"]))
        move, turn = maps.move * SCALES / MM, maps.turn * SCALES / MRAD
        rows = [move, turn[:, :2], turn[:, 2:]]
        return np.array([
            [float(weight @ np.sum(row[:, :, own] ** 2, axis=(1, 2))) for own in self._columns]
            for row in rows
        ])  # fmt: skip

    def free(self, machine: Drives) -> Array:
        """1 where no flank of a drive (n, 2) is held, 0 where gravity holds one."""
        shape = (len(machine.move), JOINTS)
        match self.parameters["flanks"]:
            case "free":
                return np.ones(shape)
            case "held":
                return np.zeros(shape)
        torque = gravity_torque(machine, number(self.parameters["payload_kg"]))[:, :JOINTS]
        friction = number(self.parameters["friction_torque_Nm"])
        return np.asarray(np.abs(torque) <= friction, dtype=float)

    @cached_property
    def squares(self) -> dict[str, Array]:
        """(2,) [mm^2 per arcmin^2] of position: `backlash` counts poses without a held flank only,
        `wave` all; and of the yaw [mrad^2 per arcmin^2], `yaw_backlash` and `yaw_wave`.
        """
        machine = self.drives
        move = machine.squares[:, :JOINTS] * (ARCMIN / MM) ** 2
        yaw = machine.turn[:, 2, :JOINTS] ** 2 * (ARCMIN / MRAD) ** 2
        free = self.free(machine)
        return {
            "backlash": machine.mean(free * move),
            "wave": machine.mean(move),
            "yaw_backlash": machine.mean(free * yaw),
            "yaw_wave": machine.mean(yaw),
        }

    @property
    def held_percent(self) -> float:
        """Poses and drives at which gravity holds a flank, in percent."""
        return float(100.0 * (1.0 - self.drives.mean(self.free(self.drives)).mean()))

    @cached_property
    def wind_up(self) -> float:
        """Rms displacement [mm] by the payload's torque on drives 1 and 2."""
        torque = gravity_torque(self.drives, number(self.parameters["payload_kg"]))[:, :JOINTS]
        angle = torque / number(self.parameters["stiffness_Nm_per_arcmin"]) * ARCMIN
        moved = np.einsum("nij,nj->ni", self.drives.move[:, :, :JOINTS], angle)
        return float(np.sqrt(self.drives.mean(np.sum(moved**2, axis=1))) / MM)

    def variation(self, rms: Array) -> Array:
        """vAP (n,) [mm] of reducers of rms backlashes (n, 2) [arcmin]: rms over the ring."""
        machine = self.drives
        free = np.hstack([self.free(machine), np.zeros((len(machine.move), 1))])
        found = [
            machine.mean(machine.variation(np.append(one * ARCMIN, 0.0), free=free)) for one in rms
        ]
        return np.sqrt(np.array(found)) / MM

    # ---------------------------------------------------------------- Monte Carlo

    def sampled(self, samples: int, dimensions: int, rng: np.random.Generator) -> Sampled:
        """The machine at poses drawn evenly over the task ring, with units for the accuracy."""
        ring = declared.task_ring(self.parameters)
        given = declared.manipulator(self.parameters)
        low, high = (ring.r[0], ring.z[0]), (ring.r[1], ring.z[1])
        places = sobol_poses(low, high, rng)
        r, z = places.T
        if self.parameters["index"] == "rms_volume":
            share = (r - ring.r[0]) / (ring.r[1] - ring.r[0])
            r = np.sqrt(ring.r[0] ** 2 + share * (ring.r[1] ** 2 - ring.r[0] ** 2))
        even = np.full(len(r), 1.0 / len(r))
        machine = drives(given, r, z, even)
        maps = links(given, r, z, str(self.parameters["calibrated"])).move * SCALES
        each = np.stack(
            [np.einsum("nik,njk->nij", maps[:, :, own], maps[:, :, own]) for own in self._columns]
        )
        own = Drives(even, machine.move[:, :, :JOINTS], machine.turn[:, :, :JOINTS])
        sample = AccuracySample.draw(samples, len(r), JOINTS, dimensions, rng)
        return Sampled(r, z, own, each, self.free(machine), sample)


@dataclass(frozen=True, eq=False)
class Sampled:
    """A sample of units at poses r, z (poses,) [m].

    `drives` are drives 1 and 2, `links` (variables, poses, 3, 3) what a variance of one unit^2 of
    each variable adds to the covariance of the position [m^2], `free` (poses, 2).
    """

    r: Array
    z: Array
    drives: Drives
    links: Array
    free: Array
    sample: AccuracySample

    def joint_errors(self, backlash: Array, hysteresis: float, wave_root: Array) -> Array:
        """q (units, 2) [rad]: `backlash` (units, 2) [arcmin] holds the hysteresis [arcmin]."""
        free = self.free[self.sample.pose]
        whole = np.where(free > 0.0, backlash, hysteresis) * ARCMIN
        return self.sample.joint_errors(whole, wave_root * ARCMIN, np.ones_like(free))

    def errors(self, sigma: Array, joint: Array) -> Array:
        """Position errors (units, 3) [mm] of links (variables,) and joints (units, 2) [rad]."""
        covariance = np.einsum("k,kpij->pij", sigma**2, self.links)
        return self.sample.errors(self.drives, covariance, joint) / MM
