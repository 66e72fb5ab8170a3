"""Torques of gravity on the joints of a serial arm (virtual work)."""

from __future__ import annotations

import numpy as np

from ...arrays import Array
from ..robot.joints import GRAVITY
from .frames import Frames


def gravity_torques(frames: Frames, mass: Array, centre: Array, payload: float = 0.0) -> Array:
    """Torque (n, k) [N m] that each drive must hold: m g dz/dtheta of all links beyond it.

    `mass` (k,) [kg] and `centre` (k, 3) [m] of the links, the latter in the frame after the joint;
    `payload` [kg] at the tool; gravity acts along -z of the measuring frame.
    """
    centres = frames.origin[:, 1:] + np.einsum("nkij,kj->nki", frames.turn[:, 1:], centre)
    weights = np.append(mass, payload)
    points = np.concatenate([centres, frames.tool[:, None, :]], axis=1)
    # moments of the masses about the origin, summed from the tool inwards
    mass_beyond = np.cumsum(weights[::-1])[::-1][: len(mass)]
    moment = np.cumsum((weights[:, None] * points)[:, ::-1], axis=1)[:, ::-1][:, : len(mass)]
    lever = moment - mass_beyond[:, None] * frames.origin[:, :-1]
    return np.asarray(GRAVITY * np.cross(frames.axes, lever)[..., 2])
