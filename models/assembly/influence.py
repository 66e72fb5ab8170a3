"""Influence coefficients of the final angles on transmission error amplitude and peak mesh force.

Computed once from the full model, by central differences over the period of order 40:

    TE amplitude = A_0 + |c . x + m|,  c complex (order 40; no other order appears to first order)
    peak force   = max over discs of phi_d(d_d . x) + |h_d . x|

x are the twelve final angles, m is a wave of order 40 that all units have. d_d . x is the
difference of the discs' rotations that loads disc d as much as x does on average; phi_d is the peak
force of disc d, tabulated over that difference (it is nonlinear, because an unloaded disc no longer
takes part); h_d is the component of order 40.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from .transmission import GEARS, Transmission

STEP = 1e-3
"""[rad] Half-step of the differences: the size of the document's tolerances."""
WIDEST = 40e-3
"""[rad] Ends of the tabulated difference of rotations."""
KNOTS = 81
SIZE = 12


@dataclass(frozen=True, slots=True, eq=False)
class Influence:
    """Influence coefficients of the final angles; see the module."""

    base_amplitude: float
    """A_0 [rad], without angular errors."""
    order_40: Array
    """Real and imaginary part of c, shape (2, 12)."""
    differences: Array
    """Knots of phi [rad], shape (k,)."""
    peak: Array
    """phi_d [N], shape (discs, k)."""
    force: Array
    """d_d, real and imaginary part of h_d per disc, shape (3 discs, 12) [-, N/rad, N/rad]."""
    wave: Array
    """Real and imaginary part of m [rad], shape (2,)."""

    def amplitude(self, states: Array) -> Array:
        """TE amplitude (...) [rad] of final angles (..., 12) [rad]."""
        return self.amplitude_of(states @ self.order_40.T)

    def amplitude_of(self, waves: Array) -> Array:
        """TE amplitude (...) [rad] of c . x, real and imaginary part (..., 2) [rad]."""
        whole = np.moveaxis(waves + self.wave, -1, 0)
        return np.asarray(self.base_amplitude + np.hypot(*whole))

    def peak_force(self, states: Array) -> Array:
        """Peak mesh force (...) [N] of final angles (..., 12) [rad]."""
        return self.peak_of(states @ self.force.T)

    def peak_of(self, loads: Array) -> Array:
        """Peak mesh force (...) [N] of the combinations `force` x, shape (..., 3 discs)."""
        by_disc = [
            np.interp(loads[..., 3 * disc], self.differences, curve)
            + np.hypot(loads[..., 3 * disc + 1], loads[..., 3 * disc + 2])
            for disc, curve in enumerate(self.peak)
        ]
        return np.asarray(np.max(by_disc, axis=0))


def influence(full: Transmission) -> Influence:
    """The influence coefficients of a full model."""
    wave, full = full.wave, replace(full, wave=0j)
    units = np.eye(SIZE).reshape(SIZE, 4, 3) * STEP
    up, down = full.turn(units), full.turn(-units)
    nominal = full.turn(np.zeros((1, 4, 3)))
    error = _harmonics((up.error - down.error) / (2.0 * STEP))[1]
    mean, first = _harmonics((up.force - down.force) / (2.0 * STEP))
    differences = np.linspace(-WIDEST, WIDEST, KNOTS)
    spread = np.zeros((KNOTS, 4, 3))
    for gear, sign in zip(GEARS, (0.5, -0.5), strict=True):
        spread[:, gear, 2] = sign * differences / full.mapping.absorption
    loaded = full.turn(spread).force
    slope = np.real(mean[3 * GEARS[0] + 2] - mean[3 * GEARS[1] + 2]) / 2.0
    slope = slope / full.mapping.absorption
    rows = np.stack([np.real(mean) / slope, np.real(first), np.imag(first)], axis=1)
    return Influence(
        base_amplitude=float(full.amplitude(nominal)[0]),
        order_40=np.stack([np.real(error), np.imag(error)]),
        differences=differences,
        peak=loaded.max(axis=1).T,
        force=np.moveaxis(rows, 0, -1).transpose(1, 0, 2).reshape(-1, SIZE),
        wave=np.array([wave.real, wave.imag]),
    )


def _harmonics(values: Array) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Mean and complex amplitude of the first harmonic over axis 1."""
    spectrum = np.fft.fft(values, axis=1) / values.shape[1]
    return spectrum[:, 0], 2.0 * spectrum[:, 1]
