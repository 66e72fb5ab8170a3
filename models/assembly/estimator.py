"""Kalman estimate of the state under measurement noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ...errors import Fault, raise_all
from .process import Process


@dataclass(frozen=True, slots=True, eq=False)
class Estimator:
    """Measurements at each step, and how far the estimate follows them.

    A measurement is y(k) = `measured`(k) x(k) + v(k); the estimate moves by `gain`(k) times the
    difference between measured and expected y.
    """

    measured: Array
    """Shape (N, q, n)."""
    gain: Array
    """Shape (N, n, q)."""


def kalman(
    process: Process,
    part_std: Array,
    noise_std: float | Array,
    insertion: str = "before",
    measured: Array | None = None,
) -> Estimator:
    """The estimator of least variance, from x(0) = 0 known.

    Part errors have mean 0 and standard deviations `part_std` (p,), measurements `noise_std` (a
    number or (q,)). `measured` (q, n) is the observation matrix (default: every state; C for the
    document's combined errors); parts not installed yet are not measured. Raises InputError.
    """
    observation = np.eye(process.transition.shape[-1]) if measured is None else measured
    noise = np.broadcast_to(np.asarray(noise_std, dtype=float) ** 2, len(observation))
    raise_all(_faults(process, part_std, noise, observation))
    observed = observation * _present(process, insertion)[:, None, :]
    covariance = np.zeros((observation.shape[1], observation.shape[1]))
    gains = []
    for step in range(process.steps):
        f, a = process.error[step], process.transition[step]
        added = (f * np.where(process.arriving[step], part_std, 0.0) ** 2) @ f.T
        if insertion == "after":
            covariance = covariance + added
        h = observed[step]
        spread = covariance @ h.T
        gain = spread @ np.linalg.pinv(h @ spread + np.diag(noise), hermitian=True)
        residual = np.eye(len(covariance)) - gain @ h
        covariance = residual @ covariance @ residual.T + (gain * noise) @ gain.T
        covariance = a @ covariance @ a.T + (added if insertion == "before" else 0.0)
        gains.append(gain)
    return Estimator(observed, np.stack(gains))


def _present(process: Process, insertion: str) -> NDArray[np.bool_]:
    """Shape (N, n): the states whose part is installed at the measurement of step k."""
    present = process.present
    if insertion == "before":
        present = np.vstack([np.zeros_like(present[:1]), present[:-1]])
    return present


def _faults(process: Process, part_std: Array, noise: Array, observation: Array) -> list[Fault]:
    faults = []
    parts, states = process.error.shape[-1], process.transition.shape[-1]
    if np.shape(part_std) != (parts,) or not np.all(np.asarray(part_std) >= 0.0):
        faults.append(Fault("part_std", f"must be {parts} numbers of at least 0, got {part_std}"))
    if not np.all(np.isfinite(noise)):
        faults.append(Fault("noise_std", "must be finite"))
    if observation.ndim != 2 or observation.shape[1] != states:
        faults.append(Fault("measured", f"must have {states} columns, got shape {observation.shape}"))
    return faults
