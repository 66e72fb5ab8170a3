"""Pose errors that correcting the command removes, and the residual."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from ...errors import Fault
from .forward import NoPose, exact_pose
from .geometry import Manipulator
from .inverse import posture
from .machine import about_up
from .maps import first_order, separated
from .sources import NAMES
from .vectors import rotation_vector, turned

EXACT = 1e-13
"""Position [m] that counts as exact."""
MOST_PASSES = 30


@dataclass(frozen=True, slots=True)
class Split:
    """First-order effects at poses (n,) of the 63 sources, split by what a command corrects.

    `compensatable` (n, 3, 63): the whole position error, which the three drives can remove;
    `through_orientation` (n, 3, 63): the part of it that the orientation causes; `residual` (n, 3,
    63): the residual orientation, both tilts unchanged and the yaw less dt/r, by which the machine
    is turned about z to remove dt.
    """

    compensatable: Array
    through_orientation: Array
    residual: Array


def split(manipulator: Manipulator, r: Array, z: Array, phi: Array | float = 0.0) -> Split:
    """The split maps at poses r, z [m], phi [rad], each (n,). Raises OutOfReach."""
    maps = first_order(manipulator, r, z, phi)
    radius = np.broadcast_to(np.ravel(r), len(maps.position))
    chains = posture(manipulator, radius, np.ravel(z))
    through = separated(chains)[2] @ maps.orientation
    residual = maps.orientation.copy()
    residual[:, 2] -= maps.position[:, 1] / radius[:, None]
    return Split(maps.position, through, residual)


def compensated(
    manipulator: Manipulator, r: Array | float, z: Array | float, phi: Array | float = 0.0, errors: Array | None = None
) -> Array:
    """Residual rotation vectors (..., 3) [rad] when commands make the position exact.

    Arguments as for `exact_pose`; the axes are those at the desired azimuth. The command is
    corrected by the error of the exact pose until that is below EXACT. Raises OutOfReach, NoPose.
    """
    error_vector = np.zeros(len(NAMES)) if errors is None else np.asarray(errors, dtype=float)
    r, z, phi, _ = np.broadcast_arrays(r, z, phi, error_vector[..., 0])
    command_r, command_z, ahead = r.astype(float), z.astype(float), np.zeros(r.shape)
    for _ in range(MOST_PASSES):
        pose = exact_pose(manipulator, command_r, command_z, phi + ahead, error_vector)
        x, y = command_r + pose.position[..., 0], pose.position[..., 1]
        off_r = np.hypot(x, y) - r
        off_t = np.arctan2(y, x) + ahead
        off_z = command_z + pose.position[..., 2] - z
        if max(np.abs(component).max(initial=0.0) for component in (off_r, r * off_t, off_z)) <= EXACT:
            axes = turned(np.eye(3), pose.orientation[..., None, :])
            return rotation_vector(about_up(axes, ahead[..., None]))
        command_r, command_z, ahead = command_r - off_r, command_z - off_z, ahead - off_t
    raise NoPose([Fault("compensation", "no command makes the position exact; give smaller errors")])
