"""Order spectrum of residuals in the angle domain."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy import signal

from ...models.inputs.distribution import Array
from ...models.measurable import Role
from .data import GapData
from .generic import order_grid

COLUMNS = ("output", "order", "before", "after", "threshold")
MOST = 20_000
"""Rows of a spectrum."""


def spectrum(
    data: GapData, before: dict[str, Array], after: dict[str, Array], noise: dict[str, float],
    limit: float,
) -> pd.DataFrame:  # fmt: skip
    """Amplitude of each order in the residuals (n,) by output, and what noise reaches there.

    `limit` is a threshold on minus the logarithm of a chance. Empty without an angle.
    """
    if Role.ANGLE not in data.readings or np.ptp(data.readings[Role.ANGLE]) < 0.1:
        return pd.DataFrame({name: [] for name in COLUMNS})
    rows = np.linspace(0, len(data) - 1, min(len(data), MOST)).astype(int)
    angle = np.asarray(data.readings[Role.ANGLE], dtype=float)[rows]
    orders = order_grid(data)
    parts = []
    for output in data.outputs:
        level = noise[output.name] * np.sqrt(4.0 * limit / len(rows))
        parts.append(pd.DataFrame({
            "output": output.name,
            "order": orders,
            "before": amplitudes(angle, orders, before[output.name][rows]),
            "after": amplitudes(angle, orders, after[output.name][rows]),
            "threshold": level,
        }))  # fmt: skip
    return pd.concat(parts, ignore_index=True)


def amplitudes(angle: Array, orders: Array, residual: Array) -> Array:
    """Amplitude (m,) of the wave of each order that fits residuals (n,) best."""
    left = residual - residual.mean()
    return np.abs(signal.lombscargle(angle, left, orders, normalize="amplitude"))
