"""The loaded contact as a mesh for torsional dynamics."""

from __future__ import annotations

import numpy as np

from ....arrays import Array
from ....units import ARCMIN
from ..contact.mesh import Mesh as ContactMesh
from .tabulated import TabulatedMesh

SCALE, NODES = 0.05 * ARCMIN, 161
"""Twist [rad] within which the table is densest, and the number of its twists."""
TWISTS_AT_ONCE = 16
"""Twists whose pin forces are computed in one block, to bound the memory."""


def tabulated(mesh: ContactMesh, torque: float, nodes: int = NODES) -> TabulatedMesh:
    """One unit's mesh over a turn, tabulated up to torques of +-`torque` [N m] and beyond."""
    ends = [float(np.abs(mesh.rotation(side * torque)).max()) for side in (1.0, -1.0)]

    def loads(twist: Array) -> tuple[Array, Array]:
        # a torque that resists + motion turns the carrier backward: twist = -rotation
        mesh_torque, stiffness = mesh.torque(-np.broadcast_to(twist, (len(twist), mesh.shape[1])))
        return -mesh_torque, stiffness

    def peak(twist: Array) -> Array:
        flat = twist.reshape(-1, mesh.shape[1])
        parts = np.array_split(flat, max(1, len(flat) // TWISTS_AT_ONCE))
        peaks = [mesh.pin_forces(-part).max(axis=(1, 2, 3)) for part in parts]
        return np.concatenate(peaks).reshape(twist.shape[:-1])

    return TabulatedMesh.of(loads, peak, SCALE, 1.1 * max(ends), nodes)
