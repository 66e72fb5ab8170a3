"""The inertias that turn on both sides of the mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....arrays import Array
from ....errors import Fault


@dataclass(frozen=True, slots=True)
class Train:
    """Two inertias about the mesh, under constant torques; floats, or one value per point (b,).

    The defaults are assumptions: with 108 N m/arcmin the reduced inertia of 3.1 kg m^2 has its
    first mode at 55 Hz, where reducers of this class have it.
    """

    input_inertia: Array | float = 8e-4
    """[kg m^2] at the input shaft: motor and sun."""
    load_inertia: Array | float = 4.216
    """[kg m^2] at the output."""
    damping_ratio: Array | float = 0.04
    """Damping of the first mode at the operating torque, in (0, 1); 0.02 to 0.06 is usual."""
    reduction_ratio: float = 121.0

    @property
    def reduced_inertia(self) -> Array:
        """J = J_1 J_2/(J_1 + J_2) [kg m^2], the input reflected to the output: J_1 = i^2 J_in."""
        reflected = self.reduction_ratio**2 * np.asarray(self.input_inertia, dtype=float)
        return np.asarray(reflected * self.load_inertia / (reflected + self.load_inertia))

    def mode(self, stiffness: Array) -> Array:
        """Angular frequency [rad/s] of the first mode over a stiffness [N m/rad]."""
        return np.asarray(np.sqrt(stiffness / self.reduced_inertia))

    def damping(self, stiffness: Array) -> Array:
        """c = 2 zeta sqrt(K J) [N m s/rad] over a stiffness [N m/rad]."""
        return np.asarray(2.0 * self.damping_ratio * np.sqrt(stiffness * self.reduced_inertia))

    def faults(self, place: str) -> list[Fault]:
        """Inputs for which no steady state exists."""
        problems = [
            Fault(f"{place}.{name}", f"must be finite and above 0 kg m^2, got {_text(value)}")
            for name, value in (("input_inertia", self.input_inertia), ("load_inertia", self.load_inertia))
            if not np.all(np.isfinite(value) & (np.asarray(value) > 0.0))
        ]
        ratio = np.asarray(self.damping_ratio)
        if not np.all((ratio > 0.0) & (ratio < 1.0)):
            text = f"must lie between 0 and 1 (0.02 to 0.06 is usual), got {_text(ratio)}"
            problems.append(Fault(f"{place}.damping_ratio", text))
        return problems


def _text(value: Array | float) -> str:
    """The value or values, for a message."""
    return f"{float(np.min(value)):g}" if np.ndim(value) == 0 else f"{np.asarray(value).tolist()}"
