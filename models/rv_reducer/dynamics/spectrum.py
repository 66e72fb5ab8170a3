"""Spectrum by order of a signal over whole output turns."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from ....arrays import Array

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class Spectrum:
    """Orders (m,) per output turn and complex amplitudes (..., m), in the unit of the signal.

    A component of order k is Re(amplitude exp(i k angle)); order 0 is the mean.
    """

    order: Array
    amplitude: ComplexArray

    def at(self, order: float) -> ComplexArray:
        """Amplitudes (...) of an order on the grid. Raises ValueError where it is not on it."""
        places = np.flatnonzero(np.isclose(self.order, order, rtol=0.0, atol=1e-9))
        if len(places) == 0:
            raise ValueError(f"order {order:g} is not on the grid of {self.order[1]:g}")
        return np.asarray(self.amplitude[..., places[0]])


def spectrum(signal: Array, turns: int = 1, grid: float | None = None) -> Spectrum:
    """Spectrum of signals (..., n) at n equal steps of the output angle over whole `turns`.

    Without a window, so every order k/turns is exact. A `grid` finer than 1/turns (0.25 shows
    non-integer orders) continues the signal by zeros: exact at k/turns, leaking in between.
    Raises ValueError where no whole multiple of `turns` has this grid.
    """
    n = signal.shape[-1]
    repeats = 1 if grid is None else ceil(1.0 / (grid * turns) - 1e-9)
    if grid is not None and abs(repeats * turns * grid - round(repeats * turns * grid)) > 1e-9:
        raise ValueError(f"a grid of {grid:g} orders does not fit {turns} turns")
    bins = np.fft.rfft(signal, n * repeats) / n
    weight = np.full(bins.shape[-1], 2.0)
    weight[0] = 1.0
    if n * repeats % 2 == 0:
        weight[-1] = 1.0
    return Spectrum(np.arange(bins.shape[-1]) / (turns * repeats), weight * bins)


def mean_square(lines: Spectrum) -> Array:
    """Mean square (...) of the signal, an even number of samples without a finer grid (Parseval).

    The last order is that of alternating samples: it counts fully, as the mean does.
    """
    power = np.abs(lines.amplitude) ** 2
    return np.asarray(power[..., 0] + 0.5 * power[..., 1:-1].sum(axis=-1) + power[..., -1])
