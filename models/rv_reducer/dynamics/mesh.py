"""The interface of a mesh for torsional dynamics."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ....arrays import Array


class Mesh(Protocol):
    """Torque of a mesh against its twist, at n equal steps of the output angle over one turn.

    The twist theta_in/i - theta_out [rad] winds up under a torque [N m] that resists + motion; the
    torque does not fall with it.
    """

    @property
    def samples(self) -> int:
        """Number n of output angles; even."""
        ...

    def torque(self, twist: Array) -> tuple[Array, Array]:
        """Torque [N m] and tangent stiffness [N m/rad] at twists (..., n) [rad]."""
        ...

    def equilibrium(self, torque: Array) -> Array:
        """Quasi-static twist (..., n) [rad] under torques (...) [N m]."""
        ...

    def peak_force(self, twist: Array) -> Array:
        """Largest contact force (...) [N] over the turn at twists (..., n) [rad]."""
        ...

    def resampled(self, samples: int) -> Mesh:
        """The same mesh at a multiple of its output angles."""
        ...


def operating_stiffness(mesh: Mesh, torque: Array) -> Array:
    """Mean tangent stiffness (...) [N m/rad] over a turn, under torques (...) [N m]."""
    return np.asarray(mesh.torque(mesh.equilibrium(torque))[1].mean(axis=-1))
