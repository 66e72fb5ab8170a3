"""A mesh whose input is displaced over the turn: sun runout, an eccentric input shaft."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from ....arrays import Array
from .mesh import Mesh


@dataclass(frozen=True, slots=True)
class DisplacedMesh:
    """`mesh` with a displacement excitation (n,) [rad] that the twist has before any torque."""

    mesh: Mesh
    displacement: Array

    @property
    def samples(self) -> int:
        """Number n of output angles."""
        return self.mesh.samples

    def torque(self, twist: Array) -> tuple[Array, Array]:
        """Torque [N m] and tangent stiffness [N m/rad] at twists (..., n) [rad]."""
        return self.mesh.torque(twist - self.displacement)

    def equilibrium(self, torque: Array) -> Array:
        """Quasi-static twist (..., n) [rad] under torques (...) [N m]."""
        return self.mesh.equilibrium(torque) + self.displacement

    def peak_force(self, twist: Array) -> Array:
        """Largest contact force (...) [N] over the turn at twists (..., n) [rad]."""
        return self.mesh.peak_force(twist - self.displacement)

    def resampled(self, samples: int) -> DisplacedMesh:
        """The same mesh at a multiple of its output angles."""
        finer = np.asarray(scipy.signal.resample(self.displacement, samples))
        return DisplacedMesh(self.mesh.resampled(samples), finer)
