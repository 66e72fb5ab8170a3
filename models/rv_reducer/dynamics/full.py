"""Dynamic twist at any measurements: a steady state for each of their operating points."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from ....arrays import Array
from .mesh import Mesh
from .steady import Oscillator, steady_state
from .sweep import ELEMENTS, resolved
from .train import Train


class NoSteadyState(UserWarning):
    """Operating points at which Newton's method reaches no periodic vibration."""


class FullDynamics:
    """Steady states of a train over a mesh, at the operating points of measurements."""

    def __init__(self, mesh: Mesh, train: Train, tolerance: float = 1e-7) -> None:
        self.mesh, self.train, self.tolerance = mesh, train, tolerance

    def twist(self, angle: Array, torque: Array, speed: Array) -> Array:
        """Twist (n,) [rad] at output angles [rad], torques [N m] and signed speeds [rad/s].

        NaN, and a `NoSteadyState` warning, where Newton's method reaches no steady state.
        """
        twists = np.empty(len(angle))
        pairs, row = np.unique(np.stack([torque, speed]), axis=1, return_inverse=True)
        points = Oscillator.of(self.mesh, self.train, pairs[0], pairs[1])
        for fine, chosen in resolved(self.mesh, points):
            lines = self._orders(fine, points.part(chosen))
            rows = np.flatnonzero(np.isin(row, chosen))
            twists[rows] = _summed(lines, np.searchsorted(chosen, row[rows]), angle[rows])
        self._warn(twists, pairs[:, row])
        return twists

    def _orders(self, mesh: Mesh, points: Oscillator) -> NDArray[np.complex128]:
        """Complex amplitudes (b, m) of the twist by whole orders; NaN without a steady state."""
        state = steady_state(mesh, points, self.tolerance)
        lines = np.fft.rfft(state.twist)[:, : self.mesh.samples // 2] * (2.0 / mesh.samples)
        lines[:, 0] *= 0.5
        lines[~state.converged(self.tolerance)] = np.nan
        return np.asarray(lines)

    def _warn(self, twist: Array, pairs: Array) -> None:
        if (missing := np.isnan(twist)).any():
            worst = pairs[:, np.argmax(missing)]
            rpm = worst[1] * 60.0 / (2.0 * np.pi)
            point = f"at {worst[0]:g} N m and {rpm:g} rpm"
            text = f"no steady vibration was computed {point}; measurements without a value: {missing.sum()}"
            warnings.warn(text, NoSteadyState, stacklevel=3)


def _summed(lines: NDArray[np.complex128], place: NDArray[np.intp], angle: Array) -> Array:
    """Twist (n,) of spectra (b, m), at the spectrum and the angle of each row."""
    order = np.arange(lines.shape[1])
    twist = np.empty(len(angle))
    for rows in np.array_split(np.arange(len(angle)), -(-len(angle) * len(order) // ELEMENTS)):
        waves = np.exp(1j * order * angle[rows, None])
        twist[rows] = np.einsum("nm,nm->n", lines[place[rows]], waves).real
    return twist
