"""Torque and rotation of meshes whose gaps are known: piecewise linear, hence solved exactly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from ....arrays import Array
from .gaps import Gaps

_ARMLESS = 1e-9
"""Lever arms [m] below this do not count: such a pin pushes through the disc's centre."""
_FAR = 1e3
"""A rotation [rad] at which such a pin would come to bear."""
_NUDGE = 1e-6
"""Step [rad] out of a rotation at which nothing bears."""


@dataclass(frozen=True, slots=True, eq=False)
class Discs:
    """Torque of every disc as a piecewise linear function of its rotation against the mesh.

    `knots`, `torque` and `slope` have shape (units, angles, discs, pins): where a pin comes to bear
    or lets go, the torque there and the stiffness after it; `first` is the stiffness before all
    knots. `low` and `high` (units, angles, discs) bound the rotations without torque.
    """

    knots: Array
    torque: Array
    slope: Array
    first: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, gaps: Gaps, stiffness: Array, compliance: Array) -> Self:
        """Discs with the normal stiffness [N/m] of pins and the compliance [rad/(N m)] behind."""
        arm = np.where(np.abs(gaps.lever) > _ARMLESS, gaps.lever, 0.0)
        bare = np.where(arm == 0.0, _FAR, gaps.gap / np.where(arm == 0.0, 1.0, arm))
        order = np.argsort(bare, axis=-1)
        bare = np.take_along_axis(bare, order, -1)
        arm, gap, stiff = (
            np.take_along_axis(np.broadcast_to(values, bare.shape), order, -1) for values in (arm, gaps.gap, stiffness)
        )
        slope, moment = _sums(stiff * arm**2, arm), _sums(stiff * arm * gap, arm)
        torque = slope[..., 1:] * bare - moment[..., 1:]
        behind = compliance[..., None]
        slope = slope / (1.0 + slope * behind)
        knots = bare + torque * behind
        low, high = _without_torque(knots, torque, slope, arm)
        return cls(knots, torque, slope[..., 1:], slope[..., 0], low, high)

    def at(self, rotation: Array) -> tuple[Array, Array]:
        """Torque [N m] and stiffness [N m/rad] at rotations (units, angles, discs) [rad]."""
        passed = np.sum(self.knots <= rotation[..., None], axis=-1, keepdims=True)
        knot = np.maximum(passed - 1, 0)
        start, torque, slope = (
            np.take_along_axis(values, knot, -1)[..., 0] for values in (self.knots, self.torque, self.slope)
        )
        slope = np.where(passed[..., 0] == 0, self.first, slope)
        return torque + slope * (rotation - start), slope


def _sums(values: Array, arm: Array) -> Array:
    """Sums over the pins that bear before the first knot and after each: (..., pins + 1).

    Pins with a positive arm bear after their knot, the others before it; they are summed
    separately, so that the sum is exactly zero where no pin bears.
    """
    after = np.zeros((*values.shape[:-1], values.shape[-1] + 1))
    before = after.copy()
    np.cumsum(np.where(arm > 0.0, values, 0.0), axis=-1, out=after[..., 1:])
    backward = np.cumsum(np.where(arm < 0.0, values, 0.0)[..., ::-1], axis=-1)
    before[..., :-1] = backward[..., ::-1]
    return after + before


def _without_torque(knots: Array, torque: Array, slope: Array, arm: Array) -> tuple[Array, Array]:
    """Bounds of the rotations without torque; both the same where pins of both flanks bear."""
    high = np.min(np.where(arm > 0.0, knots, np.inf), axis=-1)
    low = np.max(np.where(arm < 0.0, knots, -np.inf), axis=-1)
    last = np.sum(torque <= 0.0, axis=-1, keepdims=True) - 1
    start, value, rise = (
        np.take_along_axis(values, np.maximum(last, 0), -1)[..., 0] for values in (knots, torque, slope[..., 1:])
    )
    crossing = start - value / np.where(rise > 0.0, rise, 1.0)
    both = low > high
    return np.where(both, crossing, low), np.where(both, crossing, high)


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """The meshes of units x crank angles, ready for torques and rotations of the carrier.

    `ratio` is b'/b (`ContactGeometry.output_ratio`). `compliance` (units, angles, discs)
    [rad/(N m)] lies between each disc and the carrier, `stiffness` (units, angles, discs, pins)
    [N/m] is that of the pins along the normal; both may be broadcast from length 1.
    """

    gaps: Gaps
    discs: Discs
    ratio: float
    stiffness: Array
    compliance: Array

    @classmethod
    def of(cls, gaps: Gaps, ratio: float, stiffness: Array, compliance: Array) -> Self:
        """The mesh of `gaps`."""
        return cls(gaps, Discs.of(gaps, stiffness, compliance), ratio, stiffness, compliance)

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of units and of crank angles."""
        units, angles = self.gaps.gap.shape[:2]
        return units, angles

    def disc_torque(self, rotation: Array, extra: Array | float = 0.0) -> tuple[Array, Array]:
        """Torque and stiffness of each disc (units, angles, discs) at rotations of the carrier.

        `rotation` is (units, angles) [rad], forward from nominal; `extra` turns single discs
        further, (units, angles, discs) [rad] against the mesh.
        """
        turned = rotation[..., None] * self.ratio + self.gaps.turn + extra
        beyond, play = self._beyond(turned)
        torque, stiffness = self.discs.at(turned - play)
        free = np.abs(beyond) <= self.gaps.play
        bears = ~(free & (self.gaps.play > 0.0))
        return torque * bears, stiffness * bears

    def _beyond(self, turned: Array) -> tuple[Array, Array]:
        """Turn of discs beyond their rotations without torque, and the part of it that is play."""
        beyond = turned - np.clip(turned, self.discs.low, self.discs.high)
        return beyond, np.clip(beyond, -self.gaps.play, self.gaps.play)

    def pressed(self, rotation: Array) -> tuple[Array, Array]:
        """Torque [N m] of each disc at rotations (units, angles) [rad] of the carrier, and its turn
        against the mesh [rad] after play and compliance, (units, angles, discs).
        """
        torque, _ = self.disc_torque(rotation)
        turned = rotation[..., None] * self.ratio + self.gaps.turn
        return torque, turned - self._beyond(turned)[1] - torque * self.compliance

    def torque(self, rotation: Array, extra: Array | float = 0.0) -> tuple[Array, Array]:
        """Torque [N m] on the carrier and tangent stiffness [N m/rad], (units, angles).

        The torque is the one that holds the carrier at `rotation`; `extra` as in `disc_torque`.
        """
        torque, stiffness = self.disc_torque(rotation, extra)
        return torque.sum(axis=-1) * self.ratio, stiffness.sum(axis=-1) * self.ratio**2

    def touch(self) -> tuple[Array, Array]:
        """Rotations of the carrier at first contact backward and forward, each (units, angles).

        Rigid parts: forward minus backward is the backlash, negative where they interfere.
        """
        gaps = self.gaps
        armed = np.abs(gaps.lever) > _ARMLESS
        bare = gaps.gap / np.where(armed, gaps.lever, 1.0)
        forward = np.min(np.where(armed & (gaps.lever > 0.0), bare, np.inf), axis=-1)
        backward = np.max(np.where(armed & (gaps.lever < 0.0), bare, -np.inf), axis=-1)
        high = np.min(forward + gaps.play - gaps.turn, axis=-1)
        low = np.max(backward - gaps.play - gaps.turn, axis=-1)
        return low / self.ratio, high / self.ratio

    def rotation(self, torque: Array | float, direction: int = 1) -> Array:
        """Rotation of the carrier [rad] under a torque on it [N m], (units, angles).

        Newton's method between bounds: it ends exactly, on the right piece. Without torque it is
        the first contact in `direction` (+1 forward, -1 backward), or the balance of preloaded
        flanks.
        """
        applied = np.broadcast_to(np.asarray(torque, dtype=np.float64), self.shape)
        play, turn = self.gaps.play, self.gaps.turn
        low = np.max(self.discs.low - play - turn, axis=-1) / self.ratio
        high = np.min(self.discs.high + play - turn, axis=-1) / self.ratio
        forward = (applied > 0.0) | ((applied == 0.0) & (direction > 0))
        start = np.where(low > high, 0.5 * (low + high), np.where(forward, high, low))
        free = (applied == 0.0) & (low <= high)
        return np.where(free, start, self._newton(applied, start))

    def _newton(self, applied: Array, start: Array) -> Array:
        at = start.copy()
        low, high = np.full_like(at, -_FAR), np.full_like(at, _FAR)
        for _ in range(200):
            torque, stiffness = self.torque(at)
            miss = torque - applied
            low, high = np.where(miss < 0.0, at, low), np.where(miss > 0.0, at, high)
            ahead = at - miss / np.where(stiffness > 0.0, stiffness, np.inf)
            ahead = np.where(stiffness > 0.0, ahead, at - np.sign(miss) * _NUDGE)
            inside = (ahead > low) & (ahead < high)
            ahead = np.where(inside, ahead, 0.5 * (low + high))
            done = np.abs(miss) <= 1e-13 * np.abs(applied) + 1e-12
            if np.all(done | (np.abs(ahead - at) <= 1e-18)):
                return at
            at = np.where(done, at, ahead)
        raise ArithmeticError("Newton's method reaches no balance of torque; the errors are too large")

    def pin_forces(self, rotation: Array) -> Array:
        """Normal forces [N] on the pins, (units, angles, discs, pins)."""
        closed = self.gaps.lever * self.pressed(rotation)[1][..., None] - self.gaps.gap
        return np.asarray(self.stiffness * np.maximum(closed, 0.0))
