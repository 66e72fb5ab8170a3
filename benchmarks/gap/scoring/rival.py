"""A name as the scorer and the baselines see it: columns, and what their amplitudes may be."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from benchmarks.gap.generator.tables import Array

Columns = Callable[[Any, Array], Array]
"""Columns (n, m) at points and nonlinear parameters (p,)."""


@dataclass(frozen=True)
class Rival:
    """Columns of a name, the grids of its nonlinear parameters, and whether a single amplitude
    may have either sign; `positive`: none of several has a negative one.
    """

    name: str
    columns: Columns
    grids: tuple[tuple[float, ...], ...] = ()
    either_sign: bool = False
    linear: int = 1
    positive: bool = False

    @property
    def count(self) -> int:
        """Numbers that a fit of it has."""
        return self.linear + len(self.grids)

    def starts(self) -> Iterator[Array]:
        """Every point of the first grid, the others in their middle (geometric mean of ends)."""
        middles = [((min(grid) * max(grid)) ** 0.5,) for grid in self.grids[1:]]
        return (np.array(one, dtype=float) for one in product(*self.grids[:1], *middles))


def fixed(values: tuple[float, ...]) -> tuple[tuple[float, ...], ...]:
    return (values,)
