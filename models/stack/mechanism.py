"""The mechanism of a stack: pieces with deviations, and the requirement that follows from them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...arrays import Array
from ..expressions import Formula
from ..inputs import Distribution
from .made import Tolerances, mean_of, spread_of


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A requirement y of p toleranced parts that are built in as k >= p pieces.

    Piece i belongs to part `owner[i]`, whose tolerance t (half-width, in the part's unit) it
    shares; it deviates from its mid-limit by t z, z ~ `inputs[owner[i]]`, independently of all
    others unless `correlation` (k, k) is given. y is in the requirement's unit:

        with a formula   y = gain f(mids + scale t z), in the consistent units of the formula
        without one      y = centre + sum_i sensitivities_i t z_i

    (mean + spread z in the place of t z where parts are `AsMade`).

    `sensitivities` (k,) are dy/dx_i at the mid-limits, requirement unit per unit of the part;
    `centre` is y at the mid-limits. `lower` and `upper` are the limits of y, infinite where there
    are none. Correlated pieces are normal. `undefined` states where the formula has no value
    within the widest tolerances; empty where it has a value everywhere. `rough` are the pieces whose
    effect the sensitivities do not describe: the formula has no slope there, or a kink at the
    mid-limits. Sensitivities that are not finite are 0.
    """

    names: tuple[str, ...]
    owner: tuple[int, ...]
    inputs: tuple[Distribution, ...]
    sensitivities: Array
    centre: float
    lower: float = -np.inf
    upper: float = np.inf
    formula: Formula | None = None
    mids: Array | None = None
    scale: Array | None = None
    gain: float = 1.0
    correlation: Array | None = None
    undefined: str = ""
    rough: tuple[str, ...] = ()

    @cached_property
    def owners(self) -> NDArray[np.int64]:
        """Part of each piece, shape (k,)."""
        return np.array(self.owner, dtype=np.int64)

    @property
    def acting(self) -> NDArray[np.bool_]:
        """Whether the requirement depends on each piece, shape (k,)."""
        return np.asarray((self.sensitivities != 0.0) | np.isin(self.names, self.rough))

    @property
    def bounded(self) -> bool:
        """Whether the requirement has a limit, so that it has a yield."""
        return bool(np.isfinite(self.lower) or np.isfinite(self.upper))

    def values(self, t: Tolerances, z: Array) -> Array:
        """y (n, m) of n designs t (n, p) at the deviations z (k, m), NaN where there is none."""
        wide = spread_of(t)[:, self.owners]
        mean = mean_of(t)[:, self.owners]
        if self.formula is None or self.mids is None or self.scale is None:
            shift = (mean @ self.sensitivities)[:, None]
            return np.asarray(self.centre + shift + (wide * self.sensitivities) @ z)
        reach, middle = wide * self.scale, self.mids + mean * self.scale
        x = {
            name: middle[:, i, None] + reach[:, i, None] * z[i]
            for i, name in enumerate(self.names)
            if name in self.formula.names
        }
        return np.broadcast_to(self.gain * self.formula.value(x), (len(t), z.shape[1]))
