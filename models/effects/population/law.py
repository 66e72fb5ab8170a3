"""The distribution of the units of a population, as a density on a lattice."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from ....arrays import Array


@dataclass(frozen=True)
class Law:
    """Log density of deviations from the model's `mean`, on a lattice of `low` + k `step`."""

    low: float
    step: float
    log: Array
    std: float
    mean: float = 0.0

    def __call__(self, x: Array) -> Array:
        """Log density at deviations x; beyond the lattice it falls as a normal's."""
        lattice = self.low + self.step * np.arange(len(self.log))
        beyond = np.maximum(lattice[0] - x, x - lattice[-1]).clip(0.0) / self.std
        return np.asarray(np.interp(x, lattice, self.log) - 0.5 * beyond**2 - 3.0 * beyond)

    @cached_property
    def histogram(self) -> Any:
        """The same as a distribution of scipy: probabilities, quantiles, draws."""
        edges = self.low + self.step * (np.arange(len(self.log) + 1) - 0.5)
        return scipy.stats.rv_histogram((np.exp(self.log), edges), density=True)

    def standardised(self, z: Array, about: float = 0.0) -> Array:
        """Log density at deviations z from `about`, in standard deviations."""
        return np.asarray(self(about + self.std * z) + np.log(self.std))

    def widened(self, growth: float) -> Law:
        """The law with every deviation multiplied by 1 + growth."""
        by = 1.0 + growth
        return replace(self, low=by * self.low, step=by * self.step, log=self.log - np.log(by), std=by * self.std)

    def mixed(self, offset: float, fraction: float) -> Law:
        """A `fraction` of the units off by `offset`: the mean moves by fraction times offset."""
        low, more = self.low + min(offset, 0.0), int(np.ceil(abs(offset) / self.step))
        x = np.asarray(low + self.step * np.arange(len(self.log) + more), dtype=np.float64)
        std = float(np.sqrt(self.std**2 + fraction * (1.0 - fraction) * offset**2))
        first, second = np.log1p(-fraction) + self(x), np.log(fraction) + self(x - offset)
        return replace(self, low=low, log=np.asarray(np.logaddexp(first, second)), std=std)
