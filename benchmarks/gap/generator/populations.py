"""Batches of units, and what hides in their backlash [arcmin]."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.gap.generator.mechanisms import Injected
from benchmarks.gap.generator.tables import Array


@dataclass(frozen=True)
class Units:
    """Units (n,) in the order of production: lot (0, 1, ...), temperature above 20 degC [K], and
    the backlash that the simulation drew for each [arcmin].
    """

    lot: NDArray[np.int64]
    tau: Array
    drawn: Array

    def __len__(self) -> int:
        return len(self.lot)

    @property
    def number(self) -> Array:
        return np.arange(len(self), dtype=float)


def units(rng: np.random.Generator, n: int, poor: str | None) -> Units:
    """A batch of lots; poor: the lots follow each other, or the hall warms up meanwhile."""
    lots = int(rng.integers(2, 5))
    lot = rng.integers(0, lots, n)
    tau = rng.uniform(-3.0, rng.uniform(8.0, 20.0), n)
    if poor == "lots one after the other":
        lot = np.sort(lot)
    if poor == "temperature follows production":
        tau = tau.max() * (np.arange(n) / n + 0.05 * rng.normal(size=n))
    return Units(lot, tau, np.zeros(n))


def process_mean_shift(rng: np.random.Generator, at: Units) -> Injected:
    """A dimension runs off its middle."""
    return Injected(np.full(len(at), rng.choice([-1.0, 1.0]) * rng.uniform(0.02, 0.3)))


def spread_inflation(rng: np.random.Generator, at: Units) -> Injected:
    """A machine that scatters more: every deviation is stretched."""
    return Injected(rng.uniform(0.2, 1.0) * (at.drawn - at.drawn.mean()))


def tool_wear_drift(rng: np.random.Generator, at: Units) -> Injected:
    """A grinding wheel that loses the same with every part."""
    return Injected(rng.uniform(0.05, 0.5) * at.number / len(at))


def lot_offset(rng: np.random.Generator, at: Units) -> Injected:
    """One lot was set up apart."""
    odd = rng.integers(0, at.lot.max() + 1)
    return Injected(rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.5) * (at.lot == odd))


def differential_thermal_expansion(rng: np.random.Generator, at: Units) -> Injected:
    """Discs warmer than the housing by a share of the temperature take up the backlash."""
    grown = 64.0 * ((1.0 + 11.5e-6 * rng.uniform(0.1, 0.8)) ** at.tau - 1.0)
    play = 2.0 * np.sqrt(1.0 - 0.8125**2) * grown / (1.3 * 39.0)
    play *= 117.0 / 121.0  # of a disc; the carrier turns less while the sun is held
    return Injected(-np.degrees(play) * 60.0)


BATCH = {
    one.__name__: one
    for one in (process_mean_shift, spread_inflation, tool_wear_drift, lot_offset,
                differential_thermal_expansion)
}  # fmt: skip
POOR_BATCH = ("lots one after the other", "temperature follows production")
