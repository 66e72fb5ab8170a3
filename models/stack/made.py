"""Scatter and mean of parts where these do not follow from their tolerances alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array


@dataclass(frozen=True, slots=True, eq=False)
class AsMade:
    """Parts of n designs, (n, p) each, in the units of the parts.

    A part deviates by mean + spread z from its mid-limit, z ~ its input, and its drawing allows
    +-limit. For parts whose scatter is proportional to their tolerance, limit = spread = t.
    `chosen` is the index of the process of each part, None where it does not matter.
    """

    limit: Array
    spread: Array
    mean: Array
    chosen: NDArray[np.int64] | None = None

    def __len__(self) -> int:
        return len(self.limit)

    def __getitem__(self, rows: slice | NDArray[np.int64] | NDArray[np.bool_]) -> AsMade:
        """Some of the designs."""
        chosen = None if self.chosen is None else self.chosen[rows]
        return AsMade(self.limit[rows], self.spread[rows], self.mean[rows], chosen)


Tolerances = Array | AsMade
"""Half-widths t (n, p), where the scatter of all parts is in proportion to them; else `AsMade`."""


def between(low: Tolerances, high: Tolerances, fraction: Array) -> Tolerances:
    """Designs at fractions (n, 1) of the distance from one design (1, p) to another."""
    limit = limit_of(low) + fraction * (limit_of(high) - limit_of(low))
    if not (isinstance(low, AsMade) and isinstance(high, AsMade)):
        return limit
    spread = low.spread + fraction * (high.spread - low.spread)
    return AsMade(limit, spread, low.mean + fraction * (high.mean - low.mean))


def limit_of(t: Tolerances) -> Array:
    """Deviation that the drawing allows (n, p)."""
    return t.limit if isinstance(t, AsMade) else t


def spread_of(t: Tolerances) -> Array:
    """Factor of z (n, p)."""
    return t.spread if isinstance(t, AsMade) else t


def mean_of(t: Tolerances) -> Array:
    """Shift of the mean of each part (n, p)."""
    return t.mean if isinstance(t, AsMade) else np.zeros_like(t)
