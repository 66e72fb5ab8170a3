"""Stacks whose processes are known from samples alone, as the repeats draw them.

Deviations are in units of the half-width that the parts were made to; processes have a standard
deviation of a third of it, the requirement is met by 99.73 % of the units at that half-width.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SIGMA = 1.0 / 3.0
"""Standard deviation of every process, in half-widths."""
OFFSET = 0.3
"""Standard deviation of true offsets that are not corrected, in those of the processes."""


@dataclass(frozen=True, slots=True)
class Case:
    """A stack: `parts`, sample size `n`, prior worth `prior` parts, means as found or corrected."""

    name: str
    parts: int
    n: int
    uneven: bool = False
    prior: float = 0.0
    as_found: bool = False

    @property
    def key(self) -> str:
        """By which its results are kept."""
        return f"{self.name}, n = {self.n}"

    @property
    def slopes(self) -> Array:
        """Sensitivities (p,)."""
        return np.geomspace(0.5, 2.0, self.parts) if self.uneven else np.ones(self.parts)

    @property
    def prices(self) -> Array:
        """b of the costs b/t (p,), in another order than the sensitivities."""
        if not self.uneven:
            return np.ones(self.parts)
        order = np.argsort(np.sin(1.0 + np.arange(self.parts)))
        return np.geomspace(0.2, 4.0, self.parts)[order]


SIZES = (10, 20, 50)


def cases() -> list[Case]:
    """Every case of the table."""
    found = [Case("9 equal parts", 9, n) for n in SIZES]
    for parts in (1, 3, 20, 40):
        found += [Case(f"{parts} part{'s' if parts > 1 else ''}", parts, n) for n in SIZES]
    found += [Case("9 uneven parts", 9, n, uneven=True) for n in SIZES]
    found += [Case("9 parts, prior of 30", 9, n, prior=30.0) for n in SIZES]
    found += [Case("30 parts, prior of 30", 30, n, prior=30.0) for n in SIZES]
    found += [Case("9 parts, means as found", 9, n, as_found=True) for n in SIZES]
    return found
