"""Errors of the angle of a geared joint: backlash, hysteresis, transmission error, wind-up.

    q = side b/2 + side h/2 + te + tau/K

b is the backlash; the side, +1 or -1, is that from which the joint was approached, unless gravity
holds a flank: then it is that of the torque for any approach, and b/2 is an offset of the drive.
h = 2 tau_f/K is the lost motion of friction, which gravity does not remove.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array

GRAVITY = 9.80665
"""Standard gravity [m/s^2]."""


@dataclass(frozen=True, slots=True)
class GearedJoint:
    """A joint driven by a reducer: angles [rad], torques [N m]; numbers or arrays that broadcast.

    `backlash` b, `wave` the amplitude of the transmission error, `stiffness` K [N m/rad] and
    `friction` tau_f >= 0.
    """

    backlash: Array | float = 0.0
    wave: Array | float = 0.0
    stiffness: Array | float = np.inf
    friction: Array | float = 0.0

    @property
    def hysteresis(self) -> Array:
        """h [rad], the lost motion of friction: 2 tau_f / K."""
        return np.asarray(2.0 * np.asarray(self.friction) / self.stiffness)

    def is_held(self, torque: Array) -> NDArray[np.bool_]:
        """Whether a torque of gravity holds a flank against friction."""
        return np.abs(torque) > self.friction

    def wind_up(self, torque: Array) -> Array:
        """tau/K [rad]."""
        return np.asarray(torque / self.stiffness)

    def displacement(self, side: Array, torque: Array | float = 0.0, phase: Array | float = 0.5 * np.pi) -> Array:
        """q [rad] approached from a `side` (+1, -1) under a torque, at a phase of the wave.

        The default phase is a zero of the wave.
        """
        torque = np.asarray(torque, dtype=float)
        flank = np.where(self.is_held(torque), np.sign(torque), side)
        backlash, wave = np.asarray(self.backlash), np.asarray(self.wave)
        turned = 0.5 * (flank * backlash + side * self.hysteresis)
        return np.asarray(turned + wave * np.cos(phase) + self.wind_up(torque))
