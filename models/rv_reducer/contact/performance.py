"""Measured quantities of a reducer from its loaded contact: quasi-static, without hysteresis.

All angles are those of the carrier with the sun held, in radians, forward positive.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....arrays import Array
from .contact import LoadedContact
from .errors import PartErrors

LOST_MOTION_SHARE = 0.03
"""Fraction of the rated torque, in either sense, at which the catalogue states lost motion."""


def backlash(contact: LoadedContact, errors: PartErrors, angles: Array) -> Array:
    """Backlash of rigid parts at every crank angle, (units, angles); negative: interference."""
    play = np.empty((errors.units, angles.size))
    for block in contact.blocks(errors, angles):
        backward, forward = block.mesh.touch()
        play[block.place] = forward - backward
    return play


def transmission_error(contact: LoadedContact, errors: PartErrors, angles: Array, torque: Array | float) -> Array:
    """theta_in/i - theta_out under a torque on the carrier [N m], (units, angles).

    Its mean over a turn holds the wind-up; without torque it is that of first contact forward, or
    of the balance of preloaded flanks.
    """
    return -contact.rotation(errors, angles, torque)


def torque_twist(contact: LoadedContact, errors: PartErrors, angles: Array, torques: Array) -> Array:
    """Mean rotation over the crank angles at each torque [N m], (units, torques)."""
    twist = np.zeros((errors.units, torques.size))
    for block in contact.blocks(errors, angles):
        for at, torque in enumerate(torques):
            turned = block.mesh.rotation(torque).sum(axis=1)
            twist[block.place[0], at] += turned / angles.size
    return twist


def lost_motion(contact: LoadedContact, errors: PartErrors, angles: Array) -> Array:
    """Difference of mean rotation between +3 % and -3 % of rated torque, (units,)."""
    torque = LOST_MOTION_SHARE * contact.rated_torque
    twist = torque_twist(contact, errors, angles, np.array([-torque, torque]))
    return twist[:, 1] - twist[:, 0]


def rigidity(contact: LoadedContact, errors: PartErrors, angles: Array, between: tuple[float, float]) -> Array:
    """Secant stiffness [N m/rad] between two fractions of the rated torque, (units,)."""
    torques = np.array(between) * contact.rated_torque
    twist = torque_twist(contact, errors, angles, torques)
    return np.asarray((torques[1] - torques[0]) / (twist[:, 1] - twist[:, 0]))


@dataclass(frozen=True, slots=True, eq=False)
class Loading:
    """Over the crank angles given, per unit: largest and mean peak pin force [N], mean number of
    loaded pins per disc, mean tangent stiffness [N m/rad] at the carrier.
    """

    peak: Array
    mean_peak: Array
    loaded: Array
    stiffness: Array


def loading(contact: LoadedContact, errors: PartErrors, angles: Array, torque: float) -> Loading:
    """The load of the pins under a torque on the carrier [N m]."""
    peak, count, stiffness = (np.empty((errors.units, angles.size)) for _ in range(3))
    for block in contact.blocks(errors, angles):
        rotation = block.mesh.rotation(torque)
        forces = block.mesh.pin_forces(rotation)
        peak[block.place] = forces.max(axis=(2, 3))
        count[block.place] = np.mean(np.sum(forces > 0.0, axis=-1), axis=-1)
        stiffness[block.place] = block.mesh.torque(rotation)[1]
    means = (values.mean(axis=1) for values in (peak, count, stiffness))
    return Loading(peak.max(axis=1), *means)
