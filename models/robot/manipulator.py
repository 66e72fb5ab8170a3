"""The parallel manipulator of document M as a machine with reducers on its drives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from ..manipulator import sources
from ..manipulator.compensation import split
from ..manipulator.geometry import Manipulator
from ..manipulator.maps import first_order
from .drives import Drives
from .joints import GRAVITY

CALIBRATED = ("none", "position")
DRIVES = tuple(f"drive_zero_{chain}_mrad" for chain in (1, 2, 3))
AT = [sources.NAMES.index(name) for name in DRIVES]
ORDER = 24


@dataclass(frozen=True, slots=True, eq=False)
class LinkMaps:
    """Maps of the 63 sources at poses (n,) [m/m, m/rad; rad/m, rad/rad]: (n, 3, 63) each.

    Where positions are calibrated, commands are corrected for the machine's own links until its
    position is exact: `move` is 0 and `turn` the residual.
    """

    move: Array
    turn: Array


def drives(manipulator: Manipulator, r: Array, z: Array, weight: Array) -> Drives:
    """The maps of the three drives at poses r, z (n,) [m]. Raises OutOfReach."""
    maps = first_order(manipulator, r, z)
    return Drives(weight, maps.position[:, :, AT], maps.orientation[:, :, AT])


def links(manipulator: Manipulator, r: Array, z: Array, calibrated: str = "none") -> LinkMaps:
    """The maps of the links' sources at poses r, z (n,) [m]. Raises OutOfReach."""
    if calibrated == "position":
        residual = split(manipulator, r, z).residual
        return LinkMaps(np.zeros_like(residual), residual)
    maps = first_order(manipulator, r, z)
    return LinkMaps(maps.position, maps.orientation)


def gravity_torque(machine: Drives, payload: float) -> Array:
    """Torque (n, joints) [N m] of a payload [kg] at the platform: m g dz/dtheta (virtual work).

    The platform hangs on inclined rods, so that arms which turn in a plane lift it as well.
    """
    return np.asarray(payload * GRAVITY * machine.move[:, 2, :])
