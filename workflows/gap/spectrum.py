"""Order spectrum of residuals in the angle domain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from ...arrays import Array
from ...models.measurable import Role
from .data import GapData
from .generic import order_grid
from .noise import Noise

COLUMNS = ("output", "order", "before", "after", "threshold")
MOST = 20_000
"""Rows of a spectrum."""
AT_ONCE = 2_000_000
"""Values of waves that are held at once."""
NODES = 1e-9
"""Fraction of a cosine's squares below which the sine has only rounding errors."""


def spectrum(data: GapData, residuals: pd.DataFrame, noises: Sequence[Noise], limit: float) -> pd.DataFrame:
    """Amplitude of each order in the residuals of every output, and the threshold by its noise.

    `limit` is a threshold on minus the logarithm of a probability. Empty without an angle.
    """
    if Role.ANGLE not in data.measurements or np.ptp(data.measurements[Role.ANGLE]) < 0.1:
        return pd.DataFrame({name: [] for name in COLUMNS})
    rows = np.linspace(0, len(data) - 1, min(len(data), MOST)).astype(int)
    angle = np.asarray(data.measurements[Role.ANGLE], dtype=float)[rows]
    orders = order_grid(data)
    parts = []
    for output, noise in zip(data.outputs, noises, strict=True):
        before, after = (residuals[f"{output.name}_{side}"].to_numpy()[rows] for side in ("before", "after"))
        columns = {
            "output": output.name,
            "order": orders,
            "before": amplitudes(angle, orders, before),
            "after": amplitudes(angle, orders, after),
            "threshold": noise.level * np.sqrt(4.0 * limit / len(rows)),
        }
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True)


def amplitudes(angle: Array, orders: Array, residual: Array) -> Array:
    """Amplitude (m,) of the wave of each order that fits residuals (n,) best.

    Least squares at each order (Lomb, Astrophys. Space Sci. 39, 1976): angles need not be even.
    """
    centred = residual - residual.mean()
    parts = np.array_split(orders, -(-len(orders) * len(angle) // AT_ONCE))
    return np.concatenate([_amplitudes(angle, part, centred) for part in parts])


def _amplitudes(angle: Array, orders: Array, residual: Array) -> Array:
    """The amplitudes of a few orders: normal equations of cosine and sine from sums of waves and of
    their squares.

    Where all angles lie on the nodes of a wave, the solution of least norm is taken.
    """
    wave = np.exp(1j * np.outer(orders, angle))
    squares, sums = np.sum(wave**2, axis=1), wave @ residual
    cross, real = squares.imag, squares.real
    equations = np.array([[len(angle) + real, cross], [cross, len(angle) - real]]) / 2.0
    inverse = np.linalg.pinv(equations.transpose(2, 0, 1), rcond=NODES, hermitian=True)
    both = inverse @ np.stack([sums.real, sums.imag], axis=1)[:, :, None]
    return np.asarray(np.hypot(both[:, 0, 0], both[:, 1, 0]))
