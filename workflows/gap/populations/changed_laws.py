"""The laws of units with one input changed, on a grid of amounts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ....models.inputs.distribution import Array
from ....models.sources import Source
from .unit_law import UnitLaw

REACH = 6.0
FACTORS = np.geomspace(0.3, 8.0, 22)
NOISES = np.linspace(0.0, 2.0, 21)
"""Standard deviations of a gauge, in those of the units."""
SHIFTS = np.concatenate([
    np.arange(-REACH, -2.5, 0.1), np.arange(-2.5, 2.5, 0.03), np.arange(2.5, REACH, 0.1)
])  # fmt: skip
"""In standard deviations of the units."""


@dataclass(frozen=True)
class ChangedLaws:
    """Log densities of the model's units with inputs changed: whatever the batch."""

    law: UnitLaw

    @cached_property
    def base(self) -> Array:
        """As it is (k,)."""
        return np.asarray(self.law.shifted(np.zeros(1))[0])

    @cached_property
    def shifts(self) -> Array:
        """With the clipped sum shifted by SHIFTS (m, k)."""
        return self.law.shifted(SHIFTS * self.law.std)

    @cached_property
    def shifts_below(self) -> Array:
        """Shares of units below, of the same."""
        return below(self.shifts)

    @cached_property
    def moved(self) -> Array:
        """With the readings shifted by every third of SHIFTS (m, k)."""
        by, x = SHIFTS[::3, None] * self.law.std, self.law.x
        return np.asarray(np.interp((x - by).ravel(), x, self.base).reshape(len(by), len(x)))

    @cached_property
    def wider(self) -> tuple[tuple[Source, Array], ...]:
        """Each input, and with its zone wider by FACTORS (m, k)."""
        inputs = [one for one in self.law.sources.inputs if one.tolerance > 0.0]
        return tuple((one, self.law.widened(one, FACTORS)) for one in inputs)

    @cached_property
    def blurred(self) -> Array:
        """Read with the noise NOISES (m, k)."""
        return self.law.blurred(NOISES * self.law.std)


def below(log: Array) -> Array:
    """Shares below of log densities (..., k)."""
    density = np.exp(log)
    total = np.cumsum(density, axis=-1) - 0.5 * density
    return np.asarray(total / density.sum(axis=-1, keepdims=True))
