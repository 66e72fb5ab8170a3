"""Assemblies put together step by step, a batch at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .estimator import Estimator
from .process import Process


@dataclass(frozen=True, slots=True, eq=False)
class Departures:
    """Departures of a real assembly from the ideal; numbers, or arrays (n,) over assemblies."""

    gain_error: float | Array = 0.0
    """The achieved adjustment is (1 + gain_error) times the commanded one."""
    dead_band: float | Array = 0.0
    """[rad] A commanded adjustment within +-dead_band moves nothing; a larger one is reduced
    by it."""
    coupling: float | Array = 0.0
    """Fraction of the movement by which a part of a later chain is installed that its counterparts
    in earlier chains follow (crankshaft 2 moves crankshaft 1, gear 2 moves gear 1)."""
    springback: float | Array = 0.0
    """Fraction of the sum of all achieved adjustments that returns after the last step."""

    def achieved(self, commanded: Array) -> Array:
        """Achieved adjustment (n, m) of the commanded one."""
        band = _column(self.dead_band)
        beyond = np.sign(commanded) * np.maximum(np.abs(commanded) - band, 0.0)
        return np.asarray((1.0 + _column(self.gain_error)) * beyond)


IDEAL = Departures()


@dataclass(frozen=True, slots=True, eq=False)
class Assembled:
    """The results of a batch of assemblies."""

    state: Array
    """Final state (..., n) [rad]."""
    adjustments: Array
    """Commanded adjustments (..., N, m) [rad]."""

    def effort(self, process: Process) -> Array:
        """Sum of u'Ru over the steps, shape (...) [rad^2]."""
        u = self.adjustments
        return np.asarray(np.einsum("...ki,kij,...kj->...", u, process.weight, u))


def assemble(
    process: Process,
    gains: Array,
    errors: Array,
    insertion: str = "before",
    departures: Departures = IDEAL,
    estimator: Estimator | None = None,
    noise: Array | None = None,
) -> Assembled:
    """Final states and adjustments of assemblies with part errors `errors` (..., p) [rad].

    `gains` (N, m, n), or a set for every assembly (..., N, m, n). At step k only the errors of
    the parts installed there are added: with `insertion` "before" the adjustment precedes them, as
    printed; with "after" it follows them. With an `estimator` the adjustment is computed from the
    estimated state; `noise` (..., N, q) [rad] is that of the measurements.
    """
    shape = np.broadcast_shapes(errors.shape[:-1], gains.shape[:-3])
    x = np.zeros((*shape, process.transition.shape[-1]))
    estimate, total, commands = x, x, []
    for step in range(process.steps):
        b = process.control[step]
        installed = _installed(process, step, errors, departures)
        if insertion == "after":
            x = x + installed
        if estimator is not None:
            estimate = _corrected(estimator, step, x, estimate, noise)
        commanded = -_times(gains[..., step, :, :], x if estimator is None else estimate)
        achieved = departures.achieved(commanded) @ b.T
        x = x @ process.transition[step].T + achieved
        estimate = estimate @ process.transition[step].T + commanded @ b.T
        total = total + achieved
        if insertion == "before":
            x = x + installed
        commands.append(commanded)
    state = x - _column(departures.springback) * total
    return Assembled(state, np.stack(commands, axis=-2))


def _column(value: float | Array) -> Array:
    """A number, or an array (n,) over assemblies as a column (n, 1)."""
    return np.asarray(value, dtype=float)[..., None]


def _times(matrix: Array, vector: Array) -> Array:
    return np.asarray((matrix @ vector[..., None])[..., 0])


def _installed(process: Process, step: int, errors: Array, departures: Departures) -> Array:
    """Change (..., n) of the state by installing the parts of a step."""
    direct = np.where(process.arriving[step], errors, 0.0) @ process.error[step].T
    return np.asarray(direct + _column(departures.coupling) * (direct @ process.coupling.T))


def _corrected(estimator: Estimator, step: int, x: Array, estimate: Array, noise: Array | None) -> Array:
    """The estimate (..., n) after the measurement of a step."""
    innovation = (x - estimate) @ estimator.measured[step].T
    if noise is not None:
        innovation = innovation + noise[..., step, :]
    return np.asarray(estimate + innovation @ estimator.gain[step].T)
