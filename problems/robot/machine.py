"""Effects of errors of links and reducers at a machine's tool: mean squares over its poses."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...models.robot import AccuracySample, Drives
from ...section import Array, Value, number
from ...units import ARCMIN, MM, MRAD

ROUNDING_MEAN_SQUARE = 1e-18
"""Square of a rotation per rotation of a drive that is rounding."""
ROUNDING = 1e-20
"""Mean square, over the largest of its kind, that is rounding: it must not be paid for."""


@dataclass(frozen=True, eq=False)
class Places:
    """A machine at poses (n,): maps, and torques of gravity.

    `drives` holds all drives, those with a reducer first; `torque` (n, geared) [N m] is that of
    gravity on these. `move` (n, 3, sources) [m] and `turn` (n, 3, sources) [rad] are by errors of
    the links of one unit each. The rows of all rotations are two tilts of the tool and its yaw.
    """

    drives: Drives
    torque: Array
    move: Array
    turn: Array

    def mean(self, values: Array) -> Array:
        """Weighted mean over the poses (first axis)."""
        return self.drives.mean(values)


@dataclass(frozen=True)
class Machine(ABC):
    """The machine that a problem's parameters mean."""

    parameters: Mapping[str, Value]

    @property
    @abstractmethod
    def geared(self) -> int:
        """Drives with a reducer."""

    @property
    @abstractmethod
    def columns(self) -> list[list[int]]:
        """The links' sources that share each variable."""

    @cached_property
    @abstractmethod
    def places(self) -> Places:
        """The machine at the poses that its mean squares are over."""

    @abstractmethod
    def drawn(self, rng: np.random.Generator) -> Places:
        """The machine at poses of equal weight for a sample."""

    @property
    def friction(self) -> Array:
        """Friction (geared,) [N m] of the reducers at their outputs."""
        return np.full(self.geared, number(self.parameters["friction_torque_Nm"]))

    @property
    def stiffness(self) -> Array:
        """Stiffness (geared,) [N m/arcmin] of the reducers."""
        return np.full(self.geared, number(self.parameters["stiffness_Nm_per_arcmin"]))

    @property
    def flanks(self) -> tuple[str, ...]:
        """Which flank of each reducer carries: gravity, free, held."""
        return (str(self.parameters["flanks"]),) * self.geared

    @property
    def calibrated(self) -> bool:
        """Whether commands are corrected for the links' errors."""
        return self.parameters["calibrated"] == "position"

    # ---------------------------------------------------------------- mean squares

    @cached_property
    def links(self) -> Array:
        """Mean squares (3, variables) of position, squareness and yaw [mm^2, mrad^2 per unit^2]."""
        places = self.places
        rows = (places.move / MM, places.turn[:, :2] / MRAD, places.turn[:, 2:] / MRAD)
        squares = [places.mean(np.sum(row**2, axis=1)) for row in rows]
        return np.array(
            [_clear_rounding(np.array([row[sources].sum() for sources in self.columns])) for row in squares]
        )

    def free(self, places: Places) -> Array:
        """1 where no flank of a drive (n, geared) is held, 0 where gravity holds one."""
        held = np.abs(places.torque) > self.friction
        stated = np.array(self.flanks)
        return np.where(stated == "gravity", ~held, stated == "free").astype(float)

    @cached_property
    def squares(self) -> dict[str, Array]:
        """(geared,) [mm^2 per arcmin^2] of position: `backlash` counts poses without a held flank
        only, `wave` all; the same of squareness and yaw [mrad^2 per arcmin^2], `tilt_backlash`,
        `tilt_wave`, `yaw_backlash` and `yaw_wave`.
        """
        places, count = self.places, self.geared
        free, turn = self.free(places), places.drives.turn[:, :, :count] ** 2
        turn = np.where(turn > ROUNDING_MEAN_SQUARE, turn, 0.0)
        by_axis = {
            "": places.drives.squares[:, :count] * (ARCMIN / MM) ** 2,
            "tilt_": turn[:, :2].sum(axis=1) * (ARCMIN / MRAD) ** 2,
            "yaw_": turn[:, 2] * (ARCMIN / MRAD) ** 2,
        }
        return {
            f"{name}{what}": _clear_rounding(places.mean(weight * square))
            for name, square in by_axis.items()
            for what, weight in (("backlash", free), ("wave", np.ones_like(free)))
        }

    @property
    def held_percent(self) -> float:
        """Poses and drives at which gravity holds a flank, in percent."""
        free = self.places.mean(self.free(self.places))
        return float(100.0 * (1.0 - free.mean())) if free.size else 0.0  # no joint has a reducer

    @cached_property
    def wound_up(self) -> Array:
        """Displacement (n, 3) [mm] by the torques of gravity on the reducers."""
        places = self.places
        angle = places.torque / self.stiffness * ARCMIN
        moved = np.einsum("nij,nj->ni", places.drives.move[:, :, : self.geared], angle)
        return np.asarray(moved / MM)

    @property
    def wind_up(self) -> float:
        """Its rms [mm]."""
        return float(np.sqrt(self.places.mean(np.sum(self.wound_up**2, axis=1))))

    @property
    def wind_up_varying(self) -> float:
        """Rms [mm] of the residual displacement after subtracting its mean over the poses."""
        varying = self.wound_up - self.places.mean(self.wound_up)
        return float(np.sqrt(self.places.mean(np.sum(varying**2, axis=1))))

    def variation(self, rms: Array) -> Array:
        """vAP (n,) [mm] of reducers of rms backlashes (n, geared) [arcmin]: rms over the poses."""
        machine = self.places.drives
        direct = machine.move.shape[2] - self.geared
        free = np.pad(self.free(self.places), ((0, 0), (0, direct)))
        backlashes = np.pad(rms * ARCMIN, ((0, 0), (0, direct)))
        variations = [machine.mean(machine.variation(backlash, free=free)) for backlash in backlashes]
        return np.sqrt(np.array(variations)) / MM

    # ---------------------------------------------------------------- Monte Carlo

    def sampled(self, samples: int, dimensions: int, rng: np.random.Generator) -> Sampled:
        """The machine at poses drawn evenly, with units for the accuracy."""
        places = self.drawn(rng)
        covariances = np.stack(
            [
                np.einsum("nik,njk->nij", places.move[:, :, sources], places.move[:, :, sources])
                for sources in self.columns
            ]
        )
        whole, count = places.drives, self.geared
        geared_drives = Drives(whole.weight, whole.move[:, :, :count], whole.turn[:, :, :count])
        sample = AccuracySample.draw(samples, len(whole.move), count, dimensions, rng)
        return Sampled(geared_drives, covariances, self.free(places), sample)


@dataclass(frozen=True, eq=False)
class Sampled:
    """A sample of units at poses.

    `drives` are those with a reducer, `links` (variables, poses, 3, 3) what a variance of one
    unit^2 of each variable adds to the covariance of the position [m^2], `free` (poses, geared).
    """

    drives: Drives
    links: Array
    free: Array
    sample: AccuracySample

    def joint_errors(self, backlash: Array, hysteresis: Array, wave_root: Array) -> Array:
        """q (units, geared) [rad]: `backlash` (units, geared) [arcmin] holds the hysteresis
        (geared,) [arcmin].
        """
        free = self.free[self.sample.pose]
        whole = np.where(free > 0.0, backlash, hysteresis) * ARCMIN
        return self.sample.joint_errors(whole, wave_root * ARCMIN, np.ones_like(free))

    def errors(self, sigma: Array, joint: Array) -> Array:
        """Position errors (units, 3) [mm] of links (variables,) and joints [rad]."""
        covariance = np.einsum("k,kpij->pij", sigma**2, self.links)
        return self.sample.errors(self.drives, covariance, joint) / MM


def _clear_rounding(squares: Array) -> Array:
    """Mean squares with 0 for those that differ from it by rounding."""
    return np.where(squares > ROUNDING * squares.max(initial=0.0), squares, 0.0)
