"""Optimal adjustment: the gains of the linear-quadratic regulator (document A)."""

from __future__ import annotations

import numpy as np

from ...arrays import Array
from ...errors import Fault, raise_all
from .process import Process

READINGS = ("printed", "consistent")
INSERTIONS = ("before", "after")


def terminal_weight(process: Process, precision: float | Array, reading: str = "printed") -> Array:
    """P(N), shape (..., n, n), of precision weights Q.

    `printed`: P(N) = Q I weights the state. `consistent`: P(N) = C'QC weights y = C x, as the
    document's cost does. A number or an array (...) of numbers stands for Q I; a square matrix
    is Q itself. Raises InputError where Q is below zero or does not fit.
    """
    observation = process.observation if reading == "consistent" else np.eye(process.transition.shape[-1])
    weight = np.asarray(precision, dtype=float)
    if weight.ndim == 2:
        raise_all(_matrix_faults(weight, len(observation)))
        return np.asarray(observation.T @ weight @ observation)
    wrong = weight[~(np.isfinite(weight) & (weight >= 0.0))]
    faults = [Fault("precision_weight", f"must be finite and at least 0, got {value:g}") for value in wrong[:1]]
    if reading not in READINGS:
        faults.append(Fault("reading", f"must be one of {', '.join(READINGS)}, got {reading}"))
    raise_all(faults)
    return np.asarray(weight[..., None, None] * (observation.T @ observation))


def _matrix_faults(weight: Array, size: int) -> list[Fault]:
    if weight.shape != (size, size):
        return [Fault("precision_weight (Q)", f"must have shape {(size, size)}, got {weight.shape}")]
    symmetric = np.allclose(weight, weight.T, rtol=1e-12, atol=0.0)
    if not symmetric or np.linalg.eigvalsh(weight)[0] < -1e-12 * np.abs(weight).max():
        return [Fault("precision_weight (Q)", "must be symmetric without negative eigenvalues")]
    return []


def gains(process: Process, terminal: Array, running: Array | None = None) -> Array:
    """K(k), shape (..., N, m, n), of u(k) = -K(k) x(k); `terminal` is P(N), shape (..., n, n).

    K(k) = (R + B'PB)^-1 B'PA with P = P(k+1), backwards from P(N). P(k) is that printed, in the
    form Q(k) + (A - BK)'P(A - BK) + K'RK, which stays symmetric and positive for any weight.
    `running` is Q(k), shape (n, n), of a cost on the state at every step; the document has none.
    """
    every_step = np.zeros(terminal.shape[-2:]) if running is None else running
    gains_by_step, ahead = [], terminal
    for step in reversed(range(process.steps)):
        a, b, r = process.transition[step], process.control[step], process.weight[step]
        through_input = b.T @ ahead
        gain = np.linalg.solve(r + through_input @ b, through_input @ a)
        closed = a - b @ gain
        turned = np.swapaxes(gain, -1, -2)
        ahead = every_step + np.swapaxes(closed, -1, -2) @ ahead @ closed + turned @ r @ gain
        gains_by_step.append(gain)
    return np.stack(gains_by_step[::-1], axis=-3)
